"""The shipped tracking model: drives simulated in all buildings, and what they teach."""
