"""The light pass: photons traced in batches, and what they leave behind."""
