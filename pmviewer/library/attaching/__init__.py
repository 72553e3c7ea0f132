"""Programs in Python and a window in another process: what they tell each other, and where they find each other."""
