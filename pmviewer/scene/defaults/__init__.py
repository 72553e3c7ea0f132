"""What a file leaves out: cameras, light, exposure's first guess."""
