"""What the window shows while a picture is young."""
