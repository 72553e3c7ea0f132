"""`pmviewer bench files FOLDER`: real files of every format, as people have them, opened, looked at and compared."""
