"""Short files as other programs write them, each by its own library where that is installed."""

import importlib
import struct
import warnings

import numpy as np

import freqid as fq

T = 0.01 * np.arange(40)
U, Y = np.sin(3 * T), np.cos(3 * T)
F = np.linspace(1, 20, 20)
G = 1 / (1 + 1j * F / 5)


def _xlsx(path):
    sheet = importlib.import_module("openpyxl").Workbook()
    sheet.active.append(["time [s]", "u", "y"])
    for row in zip(T, U, Y, strict=True):
        sheet.active.append([float(x) for x in row])
    sheet.save(path)


def _uff(path):
    pyuff = importlib.import_module("pyuff")
    sets = [
        pyuff.prepare_58(
            func_type=1, rsp_node=1, rsp_dir=1, ref_node=1, ref_dir=1, data=y, x=T, id1=name,
            abscissa_spacing=1, abscissa_inc=T[1], abscissa_min=0.0, binary=binary,
            ord_data_type=4, num_pts=len(T), ordinate_axis_units_lab="m", ver_num=0,
            load_case_id=0, rsp_ent_name="NONE", ref_ent_name="NONE", id2="NONE", id3="NONE",
            id4="NONE", id5="NONE", z_axis_value=0.0, orddenom_spec_data_type=0,
            ordinate_spec_data_type=8,
        )
        for name, y, binary in (("u", U, 0), ("y", Y, 1))
    ]  # fmt: skip
    pyuff.UFF(str(path)).write_sets(sets, "overwrite")


def _uff_response(path):
    pyuff = importlib.import_module("pyuff")
    sets = pyuff.prepare_58(
        func_type=4, rsp_node=1, rsp_dir=3, ref_node=7, ref_dir=3, data=G, x=F, id1="frf",
        rsp_ent_name="a", ref_ent_name="b", abscissa_spacing=1, binary=0,
        ordinate_spec_data_type=20, orddenom_spec_data_type=13,
    )  # fmt: skip
    pyuff.UFF(str(path)).write_sets([sets], "overwrite")


def _bag(path):
    writer = importlib.import_module("rosbags.rosbag1").Writer(path)
    stores = importlib.import_module("rosbags.typesys")
    store = stores.get_typestore(stores.Stores.ROS1_NOETIC)
    with writer:
        _numbers(writer, store, store.serialize_ros1)


def _mcap(path):
    rosbag2 = importlib.import_module("rosbags.rosbag2")
    stores = importlib.import_module("rosbags.typesys")
    store = stores.get_typestore(stores.Stores.ROS2_HUMBLE)
    folder = path.with_name("ros2")
    with rosbag2.Writer(folder, version=9, storage_plugin=rosbag2.StoragePlugin.MCAP) as writer:
        _numbers(writer, store, store.serialize_cdr)
    next(folder.glob("*.mcap")).replace(path)
    (folder / "metadata.yaml").unlink()
    folder.rmdir()


def _numbers(writer, store, pack):
    kind = "std_msgs/msg/Float64"
    Number = store.types[kind]
    for topic, signal in (("/u", U), ("/y", Y)):
        at = writer.add_connection(topic, kind, typestore=store)
        for t, x in zip(T, signal, strict=True):
            writer.write(at, round(1e9 * (1 + t)), pack(Number(data=x), kind))


def _mdf(path):
    asammdf = importlib.import_module("asammdf")
    with asammdf.MDF(version="4.10") as file:
        file.append([asammdf.Signal(x, T, name=n) for n, x in (("u", U), ("y", Y))])
        file.save(path, overwrite=True)


def _ulog(path):
    """As a PX4 autopilot writes it (https://docs.px4.io/main/en/dev_log/ulog_file_format)."""
    importlib.import_module("pyulog")

    def message(kind, content):
        return struct.pack("<HB", len(content), ord(kind)) + content

    whole = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0)
    whole += message("B", bytes(40))
    whole += message("F", b"drive:uint64_t timestamp;float u;float y;")
    whole += message("A", struct.pack("<BH", 0, 0) + b"drive")
    for t, u, y in zip(T, U, Y, strict=True):
        whole += message("D", struct.pack("<HQff", 0, round(1e6 * (1 + t)), u, y))
    path.write_bytes(whole)


def _touchstone(path):
    skrf = importlib.import_module("skrf")
    S = np.moveaxis(np.array([[G, G / 2], [0 * G, 1 - G]]), 2, 0)
    at = skrf.Frequency.from_f(1e3 * F, unit="hz")
    network = skrf.Network(frequency=at, s=S, z0=50)
    network.write_touchstone(filename=path.stem, dir=str(path.parent))


def _matlab_response(path):
    importlib.import_module("scipy.io").savemat(path, {"f": F, "G": G})


def _analyser(path):
    rows = "\n".join(f"{f:.6g}\t{20 * np.log10(abs(g)):.5f}\t{np.degrees(np.angle(g)):.4f}"
                     for f, g in zip(F, G, strict=True))  # fmt: skip
    heading = (
        "Instrument: analyser\nDate: 2005-01-01\n\nFrequency [Hz]\tMagnitude [dB]\tPhase [deg]"
    )
    path.write_text(f"{heading}\n{rows}")


def _drive(inputs, outputs):
    return lambda path: fq.read(path, inputs, outputs)


# how each is written, and read
FILES = {
    "record.xlsx": (_xlsx, fq.read),
    "record.uff": (_uff, fq.read),
    "log.bag": (_bag, _drive("u.data", "y.data")),
    "log.mcap": (_mcap, _drive("u.data", "y.data")),
    "log.mf4": (_mdf, _drive("u", "y")),
    "log.ulg": (_ulog, _drive("drive.u", "drive.y")),
    "response.uff": (_uff_response, fq.read_response),
    "response.s2p": (_touchstone, fq.read_response),
    "response.mat": (_matlab_response, fq.read_response),
    "response.txt": (_analyser, fq.read_response),
}


def written(folder):
    """Those files whose libraries are there, in a folder, and what reads each."""
    found = {}
    for name, (write, read) in FILES.items():
        try:
            with warnings.catch_warnings():
                # pyuff leaves its files open
                warnings.simplefilter("ignore", ResourceWarning)
                write(folder / name)
        except ImportError:
            continue
        found[folder / name] = read
    return found
