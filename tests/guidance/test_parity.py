"""The C++ towers and segmenters against transformers and PyTorch, with the same random weights."""

import importlib
import json
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch")
transformers = pytest.importorskip("transformers")
fieldgraft = pytest.importorskip("fieldgraft", reason="the Python package is not built: ./dev build")
from guidance_references import (  # noqa: E402
    CLIP_MEAN,
    CLIP_STD,
    IMAGENET_MEAN,
    IMAGENET_STD,
    TEXTS,
    BuiltIn,
    assert_close,
    clip_image,
    clip_text,
    random_images,
    randomise,
    reference_ids,
    small_vocabulary,
    tiny_text,
    tiny_vision,
    to_pixels,
)

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize("activation", ["quick_gelu", "gelu"])
def test_clip_matches_transformers(tmp_path: Path, activation: str) -> None:
    vocabulary = small_vocabulary(tmp_path)
    config = transformers.CLIPConfig(
        text_config=tiny_text(vocabulary, hidden_act=activation),
        vision_config=tiny_vision(hidden_act=activation),
        projection_dim=24,
    )
    model = transformers.CLIPModel(config).eval()
    randomise(model)
    model.save_pretrained(tmp_path)
    guide = fieldgraft.Guidance.load(tmp_path)
    images = random_images(3, 32)
    with torch.no_grad():
        assert_close(guide.encode_text(TEXTS), clip_text(model, reference_ids(tmp_path, TEXTS, 20)))
        assert_close(guide.encode_image(images), clip_image(model, to_pixels(images, CLIP_MEAN, CLIP_STD)))
    assert not guide.has_segmenter
    assert guide.dimension == 24
    with pytest.raises(fieldgraft.InputError, match="no segmenter"):
        guide.segment(images, "red")


def test_clip_vit_b32_has_the_real_shapes(tmp_path: Path) -> None:
    """OpenAI's own widths, heads, patches and vocabulary size; two layers a tower, to be quick."""
    vocabulary = small_vocabulary(tmp_path)
    config = transformers.CLIPConfig(
        text_config={"num_hidden_layers": 2, "eos_token_id": vocabulary["<|endoftext|>"]},
        vision_config={"num_hidden_layers": 2},
    )
    model = transformers.CLIPModel(config).eval()
    randomise(model)
    model.save_pretrained(tmp_path)
    guide = fieldgraft.Guidance.load(tmp_path)
    images = random_images(1, 224)
    with torch.no_grad():
        assert_close(guide.encode_text(TEXTS), clip_text(model, reference_ids(tmp_path, TEXTS, 77)))
        assert_close(guide.encode_image(images), clip_image(model, to_pixels(images, CLIP_MEAN, CLIP_STD)))


def test_clip_resizes_as_pillow_does(tmp_path: Path) -> None:
    """A smooth picture of another size: Pillow's antialiased bicubic (CLIP's own preprocessing) and ours."""
    from PIL import Image

    vocabulary = small_vocabulary(tmp_path)
    config = transformers.CLIPConfig(text_config=tiny_text(vocabulary), vision_config=tiny_vision(), projection_dim=24)
    model = transformers.CLIPModel(config).eval()
    randomise(model)
    model.save_pretrained(tmp_path)
    x, y = np.meshgrid(np.linspace(0, 3, 100), np.linspace(0, 2, 100))
    picture = np.stack([0.5 + 0.4 * np.sin(x * y), 0.5 + 0.4 * np.cos(x), 0.5 + 0.4 * np.sin(y)], -1)
    quantised = np.round(picture * 255).astype(np.uint8)
    small = np.asarray(Image.fromarray(quantised).resize((32, 32), Image.Resampling.BICUBIC), dtype=np.float32) / 255
    with torch.no_grad():
        expected = clip_image(model, to_pixels(small[None], CLIP_MEAN, CLIP_STD))
    got = fieldgraft.Guidance.load(tmp_path).encode_image(quantised.astype(np.float32) / 255)
    assert_close(got, expected, tolerance=0.02)  # Pillow rounds to 8 bit


@pytest.mark.parametrize("refined", [False, True])
@pytest.mark.parametrize("size", [64, 112])
def test_clipseg_matches_transformers(tmp_path: Path, refined: bool, size: int) -> None:
    """At the model's own size and at another one (interpolated position embedding)."""
    vocabulary = small_vocabulary(tmp_path)
    config = transformers.CLIPSegConfig(
        text_config=tiny_text(vocabulary),
        vision_config=tiny_vision(image_size=64, patch_size=16),
        projection_dim=24,
        extract_layers=[0, 1, 3],
        reduce_dim=16,
        decoder_num_attention_heads=4,
        decoder_intermediate_size=36,
        conditional_layer=1,
        use_complex_transposed_convolution=refined,
    )
    model = transformers.CLIPSegForImageSegmentation(config).eval()
    randomise(model)
    model.save_pretrained(tmp_path)
    (tmp_path / "preprocessor_config.json").write_text(
        json.dumps({"size": {"height": size, "width": size}, "resample": 2})
    )
    guide = fieldgraft.Guidance.load(tmp_path)
    images = random_images(len(TEXTS), size)
    with torch.no_grad():
        ids = reference_ids(tmp_path, TEXTS, 20)
        expected = model(input_ids=ids, pixel_values=to_pixels(images, IMAGENET_MEAN, IMAGENET_STD)).logits
        assert_close(guide.segment(images, TEXTS), expected.reshape(len(TEXTS), size, size))
        assert_close(guide.encode_text(TEXTS), clip_text(model.clip, ids))


def test_a_clip_borrows_a_clipsegs_segmenter(tmp_path: Path) -> None:
    clip, clipseg = tmp_path / "clip", tmp_path / "clipseg"
    for folder in (clip, clipseg):
        folder.mkdir()
        vocabulary = small_vocabulary(folder)
    towers = {"text_config": tiny_text(vocabulary), "vision_config": tiny_vision(), "projection_dim": 24}
    transformers.CLIPModel(transformers.CLIPConfig(**towers)).save_pretrained(clip)
    segmenter = transformers.CLIPSegForImageSegmentation(
        transformers.CLIPSegConfig(**towers, extract_layers=[1, 2], reduce_dim=16, decoder_intermediate_size=36)
    ).eval()
    randomise(segmenter)
    segmenter.save_pretrained(clipseg)
    (clipseg / "preprocessor_config.json").write_text(json.dumps({"size": 32}))
    guide = fieldgraft.Guidance.load(clip, segmenter=clipseg)
    images = random_images(2, 32)
    pixels = to_pixels(images, IMAGENET_MEAN, IMAGENET_STD)
    with torch.no_grad():
        expected = segmenter(input_ids=reference_ids(clipseg, ["red", "ball"], 20), pixel_values=pixels).logits
    assert_close(guide.segment(images, ["red", "ball"]), expected.reshape(2, 32, 32))


@pytest.mark.parametrize("stem_pool", [False, True])
@pytest.mark.parametrize("conditional", [3, -1])
def test_built_in_layout_matches_pytorch(tmp_path: Path, stem_pool: bool, conditional: int) -> None:
    reference = BuiltIn(tmp_path, stem_pool, conditional)
    guide = fieldgraft.Guidance.load(tmp_path)
    images = random_images(len(TEXTS), 64)
    pixels = to_pixels(images, CLIP_MEAN, CLIP_STD)
    with torch.no_grad():
        ids = reference_ids(tmp_path, TEXTS, 20)
        text = reference.text(input_ids=ids).text_embeds
        assert_close(guide.encode_text(TEXTS), text)
        assert_close(guide.encode_image(images), reference.embed(pixels))
        assert_close(guide.segment(images, TEXTS), reference.segment(pixels, text))


@pytest.mark.parametrize("stages", [(0, 2, 3, 4), (1, 2, 3, 4)])
def test_the_training_networks_are_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, stages: tuple) -> None:
    """The folder that models/train.py writes: its own networks, vocabulary and float16 file against the C++ room."""
    monkeypatch.syspath_prepend(str(ROOT / "models"))
    network, folder, tokenizer = (importlib.import_module(name) for name in ("network", "folder", "tokenizer"))
    texts = ["red ball", "a photo of a striped chair without back", "ball", "snow on a house; don't"]
    words = tokenizer.CaptionTokenizer.train(texts * 3, network.CONTEXT_LENGTH)
    size = len(words.vocab)
    model = network.Guidance(network.default_config(width=8, text_width=64, dim=32, stages=stages, vocab_size=size))
    randomise(model)
    with torch.no_grad():
        for name, buffer in model.named_buffers():
            if "running" in name:
                buffer.copy_(0.5 + torch.rand_like(buffer))
    folder.save_folder(tmp_path, model.config, model.state_dict(), words)
    model, words = folder.load_folder(tmp_path)
    guide = fieldgraft.Guidance.load(tmp_path)
    images = random_images(len(texts), 64)
    pixels = torch.from_numpy(images).permute(0, 3, 1, 2)
    with torch.no_grad():
        text = model.encode_text(words(texts))
        assert_close(guide.encode_text(texts), text)
        assert_close(guide.encode_image(images), model.encode_image(pixels))
        assert_close(guide.segment(images, texts), model.segment(pixels, network.unit(text)))
    assert guide.unknown_words("a striped Dragon, don't") == ["dragon"]


def test_python_interface(tmp_path: Path) -> None:
    BuiltIn(tmp_path, False, -1)
    guide = fieldgraft.Guidance.load(str(tmp_path))
    images = random_images(2, 64)
    assert guide.encode_text("red ball").shape == (1, 24)
    assert guide.encode_text(["red ball"]).dtype == np.float32
    assert np.array_equal(guide.encode_image(images[0]), guide.encode_image(images[:1]))
    assert np.array_equal(guide.encode_image(np.asfortranarray(images)), guide.encode_image(images.astype(np.float64)))
    assert guide.segment(images[:, :50, :40], "red").shape == (2, 50, 40)
    assert guide.templates == ["{}", "a photo of {}"]
    assert len(guide.hash()) == 64
    with pytest.raises(ValueError, match="N×H×W×3"):
        guide.encode_image(images[..., :2])
    with pytest.raises(fieldgraft.InputError, match="nothing to edit"):
        guide.check_prompts("red ball", "Red  ball")
    with pytest.raises(fieldgraft.InputError, match="not a folder"):
        fieldgraft.Guidance.load(tmp_path / "nothing")
