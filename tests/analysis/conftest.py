"""One thread for torch, as in every run: two tests side by side would otherwise wait for each other's cores."""

import pytest
import torch


@pytest.fixture(autouse=True, scope="session")
def one_torch_thread():
    torch.set_num_threads(1)
