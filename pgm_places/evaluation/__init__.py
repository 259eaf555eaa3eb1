"""Evaluation: metrics, confidence intervals and cross-validation folds."""
