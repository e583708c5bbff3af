"""A scene: everything that is known about an experiment."""

from lightfield.scene.scene import Detector, Lamp, Parameter, Scene, Tank, Water

__all__ = ["Detector", "Lamp", "Parameter", "Scene", "Tank", "Water"]
