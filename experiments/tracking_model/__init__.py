"""The shipped tracking model: training on drives simulated in all buildings."""
