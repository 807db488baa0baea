import numpy as np

from vnca.core import FloatArray
from vnca.core.volume import Volume
from vnca.features.vgg import VGG16
from vnca.training.config import SmokeConfig
from vnca.training.run import PREVIEW_SIZE, preview_sheet
from vnca.training.scenes.smoke import PREVIEW_VIEWS
from vnca.training.trainers import smoke_trainer


def test_a_preview_shows_the_style_and_every_view(
    tiny_smoke: Volume, style: FloatArray, tiny_config: SmokeConfig, vgg: VGG16
) -> None:
    sheet = preview_sheet(smoke_trainer(tiny_smoke, style, tiny_config, vgg), style)
    rows, columns, channels = sheet.shape
    assert rows >= PREVIEW_SIZE
    assert columns >= PREVIEW_SIZE * (1 + len(PREVIEW_VIEWS))
    assert channels == 3
    assert np.isfinite(sheet).all()
    assert sheet.min() >= 0
    assert sheet.max() <= 1
    parts = np.array_split(sheet, 1 + len(PREVIEW_VIEWS), axis=1)
    assert all(part.std() > 0.01 for part in parts)
