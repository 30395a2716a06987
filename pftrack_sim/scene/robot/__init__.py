"""The robot's bodies, joints, actuators and sensors."""
