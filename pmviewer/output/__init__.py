"""Files that leave the program: PNG, EXR, session files, and how radiance becomes something to look at."""
