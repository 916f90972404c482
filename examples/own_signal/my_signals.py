"""A signal of change of your own: the robot feels its surroundings darker, or brighter, than ever in training."""

from epuckhebb import ChangeSignal


class Light(ChangeSignal):
    """The largest distance of a recent light reading from its mean in training, without or with the lamp."""

    @staticmethod
    def signal(readings, nominal):
        """A number that grows with the change; the eight light sensors of the e-puck come first."""
        largest = 0.0
        for i in range(8):
            dark, lit = nominal.reading_mean[0, i], nominal.reading_mean[1, i]
            largest = max(largest, min(abs(readings[i] - dark), abs(readings[i] - lit)))
        return largest
