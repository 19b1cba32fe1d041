"""HDF5 files that end anywhere, or whose trees lead back to themselves, before h5py reads them."""

import numpy as np
import pytest

import freqid as fq

h5py = pytest.importorskip("h5py")

# versions of the file's format: superblocks of 0 to 3
LIBVERS = ["earliest", "v108", "latest"]


def written(path, libver):
    with h5py.File(path, "w", libver=libver) as file:
        file["time"] = 0.01 * np.arange(60)
        file["u"], file["y"] = np.ones(60), np.arange(60.0)
    return path.read_bytes()


@pytest.mark.parametrize("libver", LIBVERS)
def test_a_file_cut_within_its_first_block_is_refused_by_name(tmp_path, libver):
    content = written(tmp_path / "whole.h5", libver)
    path = tmp_path / "cut.h5"
    for length in range(97):
        path.write_bytes(content[:length])
        for reads in (fq.read, lambda p: fq.open(p, "u", "y").load()):
            with pytest.raises(ValueError, match=r"cut\.h5"):
                reads(path)


@pytest.mark.parametrize("libver", LIBVERS)
def test_whole_files_of_each_version_are_read(tmp_path, libver):
    written(tmp_path / "whole.h5", libver)
    assert fq.read(tmp_path / "whole.h5").n_samples == 60


def test_a_node_that_is_its_own_sibling_is_refused(tmp_path):
    content = bytearray(written(tmp_path / "whole.h5", "earliest"))
    node = content.index(b"TREE")
    # the address of the sibling on the right, behind signature, type, level, count and the left one
    content[node + 16 : node + 24] = node.to_bytes(8, "little")
    path = tmp_path / "circle.h5"
    path.write_bytes(content)
    with pytest.raises(ValueError, match=r"circle\.h5.*its own sibling"):
        fq.read(path)
