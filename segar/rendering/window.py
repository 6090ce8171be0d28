"""A window on the screen. With SDL_VIDEODRIVER=dummy it works where there is no screen."""

import numpy as np
import pygame

from segar.errors import SegarError


class Window:
    """A window of ``size`` (width, height) [px].

    Raises:
        SegarError: there is no screen.
    """

    def __init__(self, size: tuple[int, int], title: str) -> None:
        try:
            pygame.display.init()
            self._window = pygame.Window(title, size)
        except pygame.error as error:
            raise SegarError(
                f"no window can be opened: {error}; where there is no screen, set SDL_VIDEODRIVER=dummy, or use"
                " render_mode='rgb_array'"
            ) from error
        self._clock = pygame.time.Clock()
        self.is_open = True

    def show(self, picture: np.ndarray | pygame.Surface, rate: float) -> None:
        """Show a picture, not more often than ``rate`` times a second; nothing once the user closed the window."""
        self._look_for_close()
        if not self.is_open:
            return
        if isinstance(picture, np.ndarray):
            picture = pygame.surfarray.make_surface(picture.swapaxes(0, 1))
        self._window.get_surface().blit(picture, (0, 0))
        self._window.flip()
        self._clock.tick(rate)

    def close(self) -> None:
        if self.is_open:
            self._window.destroy()
            self.is_open = False

    def _look_for_close(self) -> None:
        """Close if the user asked for it; what concerns other windows stays in the queue."""
        pygame.event.pump()
        for event in pygame.event.get(pygame.WINDOWCLOSE):
            if event.window is self._window:
                self.close()
            else:
                pygame.event.post(event)
