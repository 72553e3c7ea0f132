"""How the picture is made, pixel by pixel: kernels of their own, that the eye pass pays nothing for."""
