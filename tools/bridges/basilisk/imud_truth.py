"""ImudTruth: a Basilisk module in Python that sends a spacecraft's true motion to imud in each step of its task.

Copy this file, lockstep_client.py and, for real time, realtime_client.py beside the scenario:

    truth = ImudTruth("127.0.0.1", 9810)                 # for: imud run imu.toml --set clock=lockstep
    truth.scStateInMsg.subscribeTo(spacecraft.scStateOutMsg)
    simulation.AddModelToTask("dynamics", truth, 1)      # a lower priority than the spacecraft's: it runs after it

The accumulated velocity is what makes this the best of all truths: no thrust pulse is missed, whatever the step is.
"""
from Basilisk.architecture import bskLogging, messaging, sysModel

from lockstep_client import LockstepClient, Truth


class ImudTruth(sysModel.SysModel):
    """In lockstep the step ends when imud has emitted all samples up to it; in real time it ends when it is due."""

    def __init__(self, address, port, is_realtime=False):
        super().__init__()
        self.ModelTag = "imudTruth"
        self.scStateInMsg = messaging.SCStatesMsgReader()
        self._where, self._is_realtime, self._client = (address, port), is_realtime, None

    def Reset(self, CurrentSimNanos):
        """Begins a run of imud's."""
        if not self.scStateInMsg.isLinked():
            self.bskLogger.bskLog(bskLogging.BSK_ERROR, "imudTruth.scStateInMsg is not linked")
        if self._client is not None:
            self._client.close()
        if self._is_realtime:
            from realtime_client import RealtimeClient
            self._client = RealtimeClient(*self._where)
        else:
            self._client = LockstepClient(*self._where)

    def UpdateState(self, CurrentSimNanos):
        state = self.scStateInMsg()
        truth = Truth(
            simulation_time_ns=CurrentSimNanos, r_BN_N=state.r_BN_N, v_BN_N=state.v_BN_N, sigma_BN=state.sigma_BN,
            omega_BN_B=state.omega_BN_B, omegaDot_BN_B=state.omegaDot_BN_B,
            specific_force_B=state.nonConservativeAccelpntB_B,
            # A vector accumulated in inertial space, in the axes of the body at this instant.
            accumulated_dv_inertial_B=state.TotalAccumDV_BN_B)
        if self._is_realtime:
            self._client.send(truth)
        elif not self._client.step(truth).accepted:
            raise RuntimeError("imud refused the truth; its log has the cause")
