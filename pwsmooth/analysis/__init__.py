"""What follows from a model without a long run: sticking regions, folds, capture thresholds."""
