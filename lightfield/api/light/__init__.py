"""Light on detectors and for cameras: rendered, and compared with the closed-form model."""
