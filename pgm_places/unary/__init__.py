"""Unary models: from scans and features to scores of each label."""
