"""The paper's experiments: each section as a configuration and a function, run by one command."""
