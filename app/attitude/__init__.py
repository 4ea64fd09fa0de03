"""From matched stars to the camera's attitude and optics."""
