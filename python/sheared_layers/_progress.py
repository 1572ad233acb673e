"""Progress display of a run: a bar in a notebook or a terminal, a user function, or nothing."""


class _Bar:
    """A bar of tqdm, in its form for notebooks or terminals."""

    def __init__(self):
        from tqdm.auto import tqdm

        self._bar = tqdm(total=1.0, bar_format="{percentage:3.0f} %|{bar}| {desc}", leave=True)

    def update(self, fraction, message):
        self._bar.n = fraction
        self._bar.set_description_str(message)

    def close(self):
        self._bar.close()


class _Callback:
    """A function that receives the progress of the run."""

    def __init__(self, function):
        self.update = function

    def close(self):
        pass


def bar(progress):
    """The display for `Campaign.run(progress=...)`; None is True."""
    if progress is None or progress is True:
        return _Bar()
    if progress is False:
        return _Callback(lambda fraction, message: None)
    if callable(progress):
        return _Callback(progress)
    raise TypeError(
        f"progress must be True, False, or a function of a fraction and a text, got {type(progress).__name__}"
    )
