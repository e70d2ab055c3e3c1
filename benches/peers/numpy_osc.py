"""One arm under operational space control (Khatib 1987) in NumPy: what a Python program would run on our scenes and targets."""

import mujoco
import numpy as np

SPEED_DAMPING = 100.0  # 1/s, of joints beyond their speed limit, as ours


class Arm:
    """Drives one arm and its gripper of the scene that ours wrote."""

    def __init__(self, model, data, index, description):
        self.model, self.data, self.gains = model, data, description["gains"]
        joint = model.joint(f"arm{index}/joint1")
        finger = model.joint(f"arm{index}/finger1")
        self.q, self.v = slice(joint.qposadr[0], joint.qposadr[0] + 7), slice(joint.dofadr[0], joint.dofadr[0] + 7)
        self.finger = finger.qposadr[0]
        first = model.actuator(f"arm{index}/joint1").id
        self.ctrl, self.drive = slice(first, first + 7), first + 7
        self.limit = model.actuator_ctrlrange[self.ctrl, 1]
        self.force = model.actuator_ctrlrange[self.drive, 1]
        self.speed, self.spring = np.array(description["velocity"]), description["spring"]
        self.site = model.site(f"arm{index}/tool").id
        self.jacobian = np.zeros((6, model.nv))
        gains = self.gains
        self.stiffness = np.array([gains["position"]] * 3 + [gains["rotation"]] * 3)
        self.damping = 2 * gains["ratio"] * np.sqrt(self.stiffness)
        self.rotation, self.quaternion, self.turn = np.zeros(4), np.zeros(4), np.zeros(3)
        self.error = np.zeros(6)

    def pose_error(self, position, quaternion):
        """Linear, then angular, world frame; each no longer than the gains allow."""
        error = self.error
        error[:3] = position - self.data.site_xpos[self.site]
        mujoco.mju_mat2Quat(self.quaternion, self.data.site_xmat[self.site])
        mujoco.mju_negQuat(self.quaternion, self.quaternion)
        mujoco.mju_mulQuat(self.rotation, quaternion, self.quaternion)
        mujoco.mju_quat2Vel(self.turn, self.rotation, 1.0)
        error[3:] = self.turn
        for part, most in ((error[:3], self.gains["far"]), (error[3:], self.gains["turned"])):
            norm = np.sqrt(part @ part)
            if norm > most:
                part *= most / norm
        return error

    def task_inertia(self, inverse):
        """Damped near a singular pose only."""
        gains = self.gains
        distance = 0.0
        try:
            inertia = np.linalg.inv(inverse)
            distance = 1.0 / np.trace(inertia)
        except np.linalg.LinAlgError:
            inertia = None
        if inertia is not None and distance >= gains["onset"]:
            return inertia
        return np.linalg.inv(inverse + np.eye(6) * gains["damping"] * (1 - max(distance, 0.0) / gains["onset"]) ** 2)

    def command(self, full_mass, target):
        data, gains = self.data, self.gains
        mujoco.mj_jacSite(self.model, data, self.jacobian[:3], self.jacobian[3:], self.site)
        jacobian, mass = self.jacobian[:, self.v], full_mass[self.v, self.v]
        q, v = data.qpos[self.q], data.qvel[self.v]
        bias = data.qfrc_bias[self.v] - data.qfrc_passive[self.v]
        error = self.pose_error(target[:3], target[3:7])
        acceleration = self.stiffness * error + self.damping * (target[7:13] - jacobian @ v)
        inverse_mass_jt = np.linalg.solve(mass, jacobian.T)
        inertia = self.task_inertia(jacobian @ inverse_mass_jt)
        posture = mass @ (gains["posture"] * (target[13:20] - q) - 2 * np.sqrt(gains["posture"]) * v)
        # The task's forces, and the posture's torques less what they would do to the task.
        wanted = jacobian.T @ (inertia @ (acceleration - inverse_mass_jt.T @ posture)) + posture
        excess = v - np.clip(v, -self.speed, self.speed)
        if excess.any():
            wanted -= mass @ excess * SPEED_DAMPING
        room = self.limit - np.minimum(np.abs(bias), self.limit)
        scale = np.min(room / np.maximum(np.abs(wanted), room))
        data.ctrl[self.ctrl] = np.clip(wanted * scale + bias, -self.limit, self.limit)
        pull = -target[21] if target[20] == 1.0 else self.spring * (target[21] - data.qpos[self.finger])
        data.ctrl[self.drive] = min(max(pull, -self.force), self.force)


def arms(model, data, description, count):
    """All arms of the scene at the start of the trial that `description` tells of."""
    data.qpos[:] = description["qpos"]
    mujoco.mj_forward(model, data)
    return [Arm(model, data, index, description) for index in range(count)]


def mass_matrix(model, data, mass):
    """Fills the full mass matrix; its call has changed between versions."""
    mujoco.mj_fullM(model, mass, data.qM) if hasattr(data, "qM") else mujoco.mj_fullM(model, data, mass)
