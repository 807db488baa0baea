"""The optical flow network that is shipped."""

from importlib import resources
from pathlib import Path

import pytest
import torch
from safetensors.torch import save_file
from torch import Generator, Tensor
from torch.nn import functional

from vnca.core.errors import FileFormatError, ShapeError
from vnca.features.flow import FlowNetwork, _moved_back


@pytest.fixture(scope="module")
def network() -> FlowNetwork:
    return FlowNetwork.load()


def texture(count: int, rows: int, columns: int, seed: int = 0) -> Tensor:
    """Noise of about eight pixels, grey 0.5 ± 0.15, with a margin to be cut out of."""
    noise = torch.randn(count, 1, rows + 36, columns + 36, generator=Generator().manual_seed(seed))
    for _ in range(2):
        noise = functional.avg_pool2d(noise, 5, stride=1)
    return (0.5 + 0.15 * noise / noise.std()).clamp(0, 1)[:, 0]


def moved(source: Tensor, right: int, down: int) -> tuple[Tensor, Tensor]:
    """Two cuts out of a picture between which it moves."""
    rows, columns = source.shape[1] - 28, source.shape[2] - 28
    before = source[:, 14 : 14 + rows, 14 : 14 + columns]
    after = source[:, 14 - down : 14 - down + rows, 14 - right : 14 - right + columns]
    return before, after


@pytest.mark.parametrize(("right", "down"), [(1, 0), (-2, 0), (0, 1), (0, -2), (3, 3), (0, 0)])
def test_a_moving_texture_is_seen_to_move_right_and_down(
    network: FlowNetwork, right: int, down: int
) -> None:
    flow = network(*moved(texture(2, 64, 96), right, down))[:, :, 8:-8, 8:-8]
    expected = torch.tensor([right, down], dtype=torch.float32)
    speed = max(expected.norm().item(), 1.0)
    assert (flow.mean(dim=(0, 2, 3)) - expected).norm() < 0.2 * speed
    assert (flow - expected.view(2, 1, 1)).norm(dim=1).mean() < 0.3 * speed


def test_motion_is_seen_although_a_third_of_the_texture_is_replaced(network: FlowNetwork) -> None:
    before, after = moved(texture(4, 96, 96), 2, 1)
    other, _ = moved(texture(4, 96, 96, seed=1), 0, 0)
    after = 0.5 + 0.7**0.5 * (after - 0.5) + 0.3**0.5 * (other - 0.5)
    found = network(before, after)[:, :, 8:-8, 8:-8].mean(dim=(0, 2, 3))
    assert functional.cosine_similarity(found, torch.tensor([2.0, 1.0]), dim=0) > 0.97


def test_a_texture_moves_inside_a_silhouette_that_stays(network: FlowNetwork) -> None:
    along = torch.linspace(-1, 1, 96)
    silhouette = torch.sigmoid(20 * (0.75 - torch.hypot(along, along[:, None])))
    before, after = (silhouette * picture for picture in moved(texture(4, 96, 96), 0, -2))
    found = network(before, after)[:, :, silhouette > 0.9].mean(dim=(0, 2))
    assert functional.cosine_similarity(found, torch.tensor([0.0, -1.0]), dim=0) > 0.97
    assert found[1] < -1


@pytest.mark.parametrize("size", [(32, 32), (33, 47), (97, 64), (130, 35)])
def test_any_size_keeps_its_size(network: FlowNetwork, size: tuple[int, int]) -> None:
    flow = network(torch.rand(1, *size), torch.rand(1, *size))
    assert flow.shape == (1, 2, *size)
    assert flow.isfinite().all()


@pytest.mark.usefixtures("unchecked_shapes")
@pytest.mark.parametrize(
    ("before", "after"), [((1, 31, 64), (1, 31, 64)), ((1, 64, 64), (1, 64, 65)), ((64, 64),) * 2]
)
def test_pictures_that_do_not_fit_are_refused(network: FlowNetwork, before, after) -> None:
    with pytest.raises(ShapeError, match="pictures for optical flow"):
        network(torch.zeros(before), torch.zeros(after))


@pytest.mark.parametrize("grey", [0.0, 0.5, 1.0])
def test_empty_pictures_give_nothing_infinite(network: FlowNetwork, grey: float) -> None:
    pair = torch.full((2, 1, 40, 40), grey, requires_grad=True)
    flow = network(pair[0], pair[1])
    flow.square().sum().backward()
    assert flow.isfinite().all()
    assert pair.grad is not None
    assert pair.grad.isfinite().all()


def test_gradients_in_both_pictures_are_right() -> None:
    network = FlowNetwork.load().double()
    pair = torch.stack(moved(texture(1, 32, 32).double(), 1, 0)).requires_grad_()
    assert torch.autograd.gradcheck(
        lambda pair: network(pair[0], pair[1]), pair, fast_mode=True, eps=1e-7, atol=1e-4
    )


def test_the_same_pair_gives_the_same_flow(network: FlowNetwork) -> None:
    pair = moved(texture(1, 64, 64), 1, 1)
    assert torch.equal(network(*pair), network(*pair))


def test_the_network_is_frozen_and_small() -> None:
    network = FlowNetwork.load()
    assert not network.training
    assert not any(p.requires_grad for p in network.parameters())
    assert len((resources.files("vnca.data") / "flow.safetensors").read_bytes()) < 1_000_000


def test_weights_come_back_as_they_were_written(tmp_path: Path, network: FlowNetwork) -> None:
    network.write(tmp_path / "flow.safetensors")
    again = FlowNetwork.read(tmp_path / "flow.safetensors")
    pair = moved(texture(1, 36, 36), 1, 0)
    assert torch.equal(network(*pair), again(*pair))


def test_files_that_hold_something_else_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "flow.safetensors"
    path.write_bytes(b"not weights at all")
    with pytest.raises(FileFormatError, match="not readable as a flow network"):
        FlowNetwork.read(path)
    save_file({"filters.weight": torch.zeros(3)}, path)
    with pytest.raises(FileFormatError, match="not a flow network written by vnca"):
        FlowNetwork.read(path)
    save_file({"filters.weight": torch.zeros(3)}, path, metadata={"format": "vnca-flow-1"})
    with pytest.raises(FileFormatError, match=r"expected the weights .* reinstall"):
        FlowNetwork.read(path)
    network = FlowNetwork()
    torch.nn.init.constant_(network.rest.bias, torch.inf)
    network.write(path)
    with pytest.raises(FileFormatError, match="not finite"):
        FlowNetwork.read(path)


@pytest.mark.parametrize("shape", [(1, 6, 7), (3, 1, 4), (2, 5, 1)])
def test_moving_a_picture_back_is_sampling_it(shape: tuple[int, int, int]) -> None:
    """Values and both gradients, against torch's own, which has none that runs agree on."""
    count, rows, columns = shape
    random = Generator().manual_seed(0)
    kind = {"dtype": torch.float64, "generator": random}
    picture = torch.rand(count, 1, rows, columns, **kind).requires_grad_()
    flow = (4 * torch.randn(count, 2, rows, columns, **kind)).requires_grad_()
    weights = torch.rand(count, 1, rows, columns, **kind)
    down = torch.arange(rows)[:, None] + flow[:, 1]
    right = torch.arange(columns) + flow[:, 0]
    grid = torch.stack([(2 * right + 1) / columns - 1, (2 * down + 1) / rows - 1], dim=-1)
    expected = functional.grid_sample(picture, grid, padding_mode="border", align_corners=False)
    found = _moved_back(picture, flow)
    torch.testing.assert_close(found, expected)
    gradients = [
        torch.autograd.grad((v * weights).sum(), (picture, flow)) for v in (expected, found)
    ]
    torch.testing.assert_close(gradients[1], gradients[0])
