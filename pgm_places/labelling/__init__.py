"""The application: a loaded model labels a map, its places are found, and all is written."""
