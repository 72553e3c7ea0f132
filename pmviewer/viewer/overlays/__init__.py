"""What is drawn over the picture in 3D."""
