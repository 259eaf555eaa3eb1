"""The pictures of the documentation, drawn from generated maps and from data of the libraries."""
