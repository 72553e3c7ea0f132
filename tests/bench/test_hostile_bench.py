"""bench hostile: the same cases everywhere, every format among them, and what counts as wrong."""

import zlib

import pytest

from pmviewer.bench.hostile import bench
from pmviewer.bench.hostile.bombs import BLOCK, zeros
from pmviewer.bench.hostile.cases import case, honest
from pmviewer.bench.hostile.judge import Finding, findings, internals
from pmviewer.bench.hostile.specials import specials
from pmviewer.errors import SettingError

MORE = len(specials())


def test_a_case_is_the_same_whenever_it_is_made():
    for index in range(MORE, MORE + 60):
        assert case(1, index) == case(1, index)
    assert [case(1, i).files for i in range(MORE, MORE + 40)] != [case(2, i).files for i in range(MORE, MORE + 40)]


def test_every_format_is_mutated():
    formats = {case(1, index).format for index in range(MORE, MORE + len(honest()))}
    assert formats == {one.format for one in honest()}
    assert {"glTF", "GLB", "OBJ", "MTL", "PLY", "STL", "PNG image", "HDR image", "EXR image", "Mitsuba XML"} < formats


def test_most_mutations_change_something():
    originals = {one.name: one.files for one in honest()}
    cases = [case(1, index) for index in range(MORE, MORE + 300)]
    assert sum(one.files != originals[one.seed] for one in cases) > 280


def test_special_files_can_be_written(tmp_path):
    names = [name for name, _ in specials()]
    assert len(set(names)) == len(names)
    for index in (0, names.index("<bitmap> names a pipe"), names.index("a buffer names a link outside")):
        path = case(1, index).write(tmp_path / str(index))
        assert path.is_file()
    assert (tmp_path / str(names.index("<bitmap> names a pipe")) / "pipe").is_fifo()


def test_a_bomb_is_what_it_says():
    count = 3 * BLOCK + 77
    assert zlib.decompress(zeros(count)) == bytes(count)
    assert len(zeros(1 << 30)) < 2 << 20


@pytest.mark.parametrize(
    "sentence",
    [
        "The texture can't be read (UnidentifiedImageError: cannot identify <_io.BytesIO object at 0x7f12ab34cd56>).",
        "The file can't be decoded (KeyError: 3).",
        "The file is damaged: 'NoneType' object has no attribute 'get'.",
        "buffer is smaller than requested size",
        "cannot reshape array of size 12 into shape (5,3)",
        "unpack requires a buffer of 4 bytes",
        "The name b'\\xff' is none.",
    ],
)
def test_python_in_a_sentence_is_found(sentence):
    assert internals(sentence)


@pytest.mark.parametrize(
    "sentence",
    [
        "scene.xml:3: The file 'KeyError.obj' named by <shape type=\"obj\"> does not exist.",
        "lines 3, 4 and 7 more: 'nan' is not a number: write one with a decimal point.",
        "The buffer needs 100000000 bytes, and the file has 136.",
        "The picture can't be read: it ends too early. Is it complete?",
        "The file has no triangle that can be shown. Error in line 3.",
    ],
)
def test_sentences_for_users_are_left_alone(sentence):
    assert not internals(sentence)


def answer(**values):
    return {"outcome": "refused", "said": ["No."], "cpu": 0.1, "memory": 1000, "where": "", **values}


def test_what_is_wrong_is_named():
    assert findings(answer(), 0) == []
    kinds = [
        (answer(outcome="traceback", said=["IndexError: x"], where="ply.py:3"), "traceback"),
        (answer(cpu=10.1), "time"),
        (answer(memory=(1 << 30) + 2000), "memory"),
        (answer(said=["It is (ValueError: x)."]), "internals"),
        (answer(said=["A" * 2000]), "long"),
    ]
    for given, kind in kinds:
        assert [finding.kind for finding in findings(given, 500)] == [kind]
    assert findings(answer(memory=(1 << 30) + 2000), 3000) == [], "beyond the honest file"


def test_the_smallest_file_stands_for_a_finding():
    finding = Finding("time", "11 CPU seconds")

    def trial(index, size, format_="PLY", found=(finding,)):
        return bench.Trial(index, "a", format_, size, "refused", 1.0, 10, list(found))

    worst = bench.smallest([trial(1, 300), trial(2, 100), trial(3, 200), trial(4, 1, found=()), trial(5, 50, "STL")])
    assert {key[1]: one.index for key, one in worst.items()} == {"PLY": 2, "STL": 5}
    result = bench.report(1, list(worst.values()), worst, 1.0)
    assert {target.id: target.value for target in result.targets}["hostile time"] == 2
    assert any("file 2" in note for note in result.notes)


def test_a_number_of_files_below_one_is_refused():
    with pytest.raises(SettingError, match="at least one"):
        bench.run(scenes=0)
