"""Persistence: labelers and backends as folders of data."""
