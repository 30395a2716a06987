"""The robot: a differential-drive base on springs, with a camera on a mast.

`add_robot` builds it, `Drive` moves and reads it, `Script` says where it goes in open-loop episodes,
`Road` shakes it.
"""

from pftrack_sim.world.robot.body import CAMERA, add_robot
from pftrack_sim.world.robot.drive import Drive
from pftrack_sim.world.robot.odometry import Calibration
from pftrack_sim.world.robot.road import Road
from pftrack_sim.world.robot.route import Script

__all__ = ["CAMERA", "Calibration", "Drive", "Road", "Script", "add_robot"]
