"""Evaluation: figures of merit, confidence intervals and folds."""
