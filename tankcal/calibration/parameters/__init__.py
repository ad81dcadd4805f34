"""Choice of the additional parameters in the model of a camera."""
