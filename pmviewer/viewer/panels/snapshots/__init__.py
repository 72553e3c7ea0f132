"""The tab "Snapshots": the strip, what is compared, and what the pictures differ by."""
