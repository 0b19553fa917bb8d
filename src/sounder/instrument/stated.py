"""Levels of an instrument, and the uncertainties of its calibration and of the survey, as far as they are stated."""

from sounder.toml import Decibels, NotNegative, NotNegativeDecibels, Table


class Transmitter(Table):
    """The transmitter.

    Attributes
    ----------
    power : float, optional
        Power into the transmit antenna [dBm]. The level of the back-to-back recording is checked against it.
    power_std : float
        Its standard deviation, with that of the cables between [dB]. The default is assumed, not measured.
    """

    power: Decibels | None = None
    power_std: NotNegativeDecibels = 3.0


class Receiver(Table):
    """The receiver.

    Attributes
    ----------
    noise_figure : float, optional
        Noise figure at the port of the receive antenna [dB]. The noise of recordings is checked against it.
    noise_figure_std : float
        Its standard deviation, with that of the scale [dB]. The default is assumed, not measured.
    """

    noise_figure: NotNegativeDecibels | None = None
    noise_figure_std: NotNegativeDecibels = 1.5


class Connection(Table):
    """The back-to-back connection: attenuator and cables in place of the antennas.

    Attributes
    ----------
    attenuation_std : float
        Standard deviation of the loss of the attenuator with its cables [dB]; part of every ``path_gain_std``.
    delay : float, optional
        Delay of the back-to-back recording, from the trigger to the peak of its response [s]. Recordings are checked
        against it.
    delay_std : float
        Standard deviation of the delay that the connection has besides its S21 [s]; part of every ``delay_std``.
    """

    attenuation_std: NotNegativeDecibels = 0.0
    delay: float | None = None
    delay_std: NotNegative = 0.0


class Survey(Table):
    """How well the places of the antennas and the pointing of the horn are known.

    Attributes
    ----------
    position_std : float
        Standard deviation of each coordinate of each antenna [m].
    heading_std, tilt_std : float
        Standard deviations of the zero of azimuth and of the zero of elevation [degree].
    """

    position_std: NotNegative = 0.0
    heading_std: NotNegative = 0.0
    tilt_std: NotNegative = 0.0
