"""Networks: encoders of observations, policies, augmentations of frames."""
