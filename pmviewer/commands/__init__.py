"""The commands of the command line, and what they share. Nothing here knows how pictures are made."""
