"""The eye pass: camera, direct light, gathering, path tracer, film."""
