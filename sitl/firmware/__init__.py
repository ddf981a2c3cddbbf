"""World, plant and sensors for the real ArduRover firmware; its parameter files."""
