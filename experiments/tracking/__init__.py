"""MLflow: the store, what is sent to it, and its pages."""
