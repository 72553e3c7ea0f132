"""Every setting: the schema, and access to it by name."""
