"""A scene: everything that is known about an experiment."""

from lightfield.scene.scene import Detector, DetectorArray, Follower, Lamp, Parameter, Scene, Tank, Water

__all__ = ["Detector", "DetectorArray", "Follower", "Lamp", "Parameter", "Scene", "Tank", "Water"]
