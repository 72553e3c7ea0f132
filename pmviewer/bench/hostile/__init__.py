"""`pmviewer bench hostile`: files that are broken, exaggerated or malicious, made by the thousand from honest ones."""
