"""Compiling ahead: in processes of their own, what the first picture needs next and what a click would need."""
