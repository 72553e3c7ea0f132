"""How functions are compiled, specialised, and kept between runs."""
