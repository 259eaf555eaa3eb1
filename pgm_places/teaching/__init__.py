"""Teaching: interactive training of a labeler from paint on a map."""
