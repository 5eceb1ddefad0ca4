#!/usr/bin/env python3
"""Golden vectors of the wire, made from protocol/SPEC.md alone: own schema, own CRC, own COBS.

Prints JSON. The committed protocol_vectors.json is this program's output and is kept for ever: a
change of the wire adds vectors, it never changes one. Rewrite with
    python3 tests/golden/make_vectors.py > tests/golden/protocol_vectors.json
"""
import json
import struct

SCALARS = {"u8": "<B", "u16": "<H", "u32": "<I", "u64": "<Q", "i32": "<i", "f32": "<f"}


def text(bound):
    return ("text", bound)


def array(kind, bound):
    return ("array", kind, bound)


def raw(size):
    return ("raw", size)


BYTES = ("bytes",)

LEDGER = [(n, "u64") for n in
          ("exposed", "delivered", "lost_sensor", "lost_firmware", "lost_link", "lost_host", "corrupt")]
RECIPE = [
    ("illuminations", array("u8", 32)), ("exposures_us", array("u32", 16)), ("exposure_mode", "u8"),
    ("max_brackets", "u8"), ("repeats", "u16"), ("off_frames", "u8"), ("off_exposure_us", "u32"),
    ("time_budget_us", "u32"), ("region_x", "u16"), ("region_y", "u16"), ("region_width", "u16"),
    ("region_height", "u16"), ("pixel_format", "u8"), ("target", "u8"), ("live_preview", "u8"),
    ("test_pattern", "u8")]
MANIFEST = [
    ("id", raw(16)), ("kind", "u8"), ("sequence", "u32"), ("unix_time_s", "u64"), ("device_time_us", "u64"),
    ("boot_count", "u32"), ("sensor_temperature_mK", "i32"), ("led_temperature_mK", "i32"),
    ("certificate_id", text(48)), ("scalars", array("f32", 6))]
KIND_STATE = [
    ("kind", "u8"), ("verdict", "u8"), ("id", raw(16)), ("age_s", "u32"), ("temperature_change_mK", "i32"),
    ("action", text(96))]
RUN_END = [
    ("run_id", "u32"), ("reason", "u8"), ("ledger", LEDGER), ("frames_sent", "u32"), ("started_us", "u64"),
    ("ended_us", "u64"), ("held_us", "u64")]

# name: (id, channel, fields)
MESSAGES = {
    "hello": (0x0001, 0, [
        ("min_wire_major", "u8"), ("max_wire_major", "u8"), ("schema_revision", "u16"), ("schema_digest", "u32"),
        ("max_payload", "u32"), ("capabilities", "u32"), ("build_id", text(32)), ("host_name", text(32))]),
    "hello_reply": (0x8001, 0, [
        ("wire_major", "u8"), ("schema_revision", "u16"), ("schema_digest", "u32"), ("max_payload", "u32"),
        ("capabilities", "u32"), ("build_id", text(32)), ("product", text(32)), ("serial", text(32)),
        ("reset_reason", "u8"), ("boot_count", "u32"), ("device_time_us", "u64"), ("epoch", "u32"),
        ("run_state", "u8")]),
    "status_reply": (0x8000, 0, [
        ("status", "u16"), ("request", "u16"), ("pending_ms", "u32"), ("text", text(128))]),
    "object_read": (0x0002, 0, [("object", "u16"), ("offset", "u32"), ("length", "u32")]),
    "object_chunk": (0x8002, 0, [
        ("object", "u16"), ("offset", "u32"), ("total", "u32"), ("object_crc", "u32"), ("data", BYTES)]),
    "get_configuration": (0x0003, 0, []),
    "configuration": (0x8003, 0, [("epoch", "u32"), ("recipe", RECIPE)]),
    "set_configuration": (0x0004, 0, [("recipe", RECIPE)]),
    "configuration_accepted": (0x8004, 0, [
        ("epoch", "u32"), ("planned_frames", "u32"), ("planned_duration_us", "u32")]),
    "start": (0x0005, 0, [("epoch", "u32"), ("may_send_until", "u32")]),
    "started": (0x8005, 0, [("run_id", "u32"), ("device_time_us", "u64")]),
    "stop": (0x0006, 0, []),
    "abort": (0x0007, 0, []),
    "run_report": (0x8006, 0, RUN_END),
    "credit": (0x0008, 1, [("run_id", "u32"), ("may_send_until", "u32")]),
    "frame_begin": (0x0101, 2, [
        ("run_id", "u32"), ("frame_id", "u32"), ("epoch", "u32"), ("calibration_id", raw(16)), ("kind", "u8"),
        ("target", "u8"), ("illumination", "u8"), ("bracket", "u8"), ("sweep", "u16"), ("exposure_us", "u32"),
        ("gain_milli", "u16"), ("sensor_temperature_mK", "i32"), ("led_temperature_mK", "i32"),
        ("monitor_uv", "u32"), ("exposure_start_us", "u64"), ("x", "u16"), ("y", "u16"), ("width", "u16"),
        ("height", "u16"), ("pixel_format", "u8"), ("bits", "u8"), ("total", "u32")]),
    "frame_data": (0x0102, 2, [
        ("run_id", "u32"), ("frame_id", "u32"), ("offset", "u32"), ("total", "u32"), ("data", BYTES)]),
    "frame_end": (0x0103, 2, [
        ("run_id", "u32"), ("frame_id", "u32"), ("saturated_pixels", "u32"), ("max_dn", "u16"), ("flags", "u16"),
        ("frame_crc", "u32"), ("readout_end_us", "u64")]),
    "run_finished": (0x0201, 1, RUN_END),
    "log_event": (0x0202, 1, [("level", "u8"), ("device_time_us", "u64"), ("text", text(128))]),
    "fault_event": (0x0203, 1, [("fault", "u16"), ("device_time_us", "u64"), ("text", text(128))]),
    "get_status": (0x0009, 0, []),
    "device_status": (0x8009, 0, [
        ("run_state", "u8"), ("device_time_us", "u64"), ("sensor_temperature_mK", "i32"),
        ("led_temperature_mK", "i32"), ("epoch", "u32"), ("run_id", "u32"), ("frames_good", "u32"),
        ("frames_bad_header", "u32"), ("frames_bad_payload", "u32"), ("bytes_skipped", "u32"),
        ("stale_session", "u32"), ("duplicates", "u32"), ("unknown_events", "u32"), ("last_fault", "u16"),
        ("calibration_records_recovered", "u32"), ("worst_poll_us", "u32")]),
    "calibration_begin": (0x000A, 0, []),
    "calibration_begun": (0x800A, 0, [("session", "u32"), ("reference_stage", "u8")]),
    "calibration_step": (0x000B, 0, [("session", "u32"), ("target", "u8")]),
    "calibration_placed": (0x800B, 0, [("placed", "u8"), ("instruction", text(128))]),
    "calibration_commit": (0x000C, 0, [("session", "u32"), ("manifest", MANIFEST)]),
    "calibration_end": (0x000D, 0, [("session", "u32")]),
    "calibration_list": (0x000E, 0, []),
    "calibration_listed": (0x800E, 0, [("manifests", array(MANIFEST, 8))]),
    "calibration_query": (0x000F, 0, []),
    "calibration_state": (0x800F, 0, [("states", array(KIND_STATE, 8))]),
    "calibration_undo": (0x0010, 0, [("kind", "u8")]),
    "calibration_restore_factory": (0x0011, 0, []),
    "key_value_get": (0x0012, 0, [("key", text(32))]),
    "key_value": (0x8012, 0, [("key", text(32)), ("value", text(64)), ("read_only", "u8")]),
    "key_value_set": (0x0013, 0, [("key", text(32)), ("value", text(64))]),
    "reboot": (0x0014, 0, []),
    "clock_sync": (0x0015, 0, [("host_time_us", "u64")]),
    "clock_synced": (0x8015, 0, [("host_time_us", "u64"), ("device_time_us", "u64")]),
    "update_begin": (0x0016, 0, [("header", raw(256))]),
    "update_write": (0x0017, 0, [("offset", "u32"), ("data", BYTES)]),
    "update_finish": (0x0018, 0, []),
    "update_confirm": (0x0019, 0, []),
    "update_status": (0x001A, 0, []),
    "update_state": (0x801A, 0, [
        ("phase", "u8"), ("received", "u32"), ("running_version", text(32)), ("other_version", text(32)),
        ("running_slot", "u8"), ("running_verdict", "u8"), ("other_verdict", "u8"), ("running_counter", "u32"),
        ("other_counter", "u32"), ("lowest_counter", "u32"), ("slot_bytes", "u32"), ("chunk_bytes", "u32")]),
    "fault_record_read": (0x001B, 0, []),
    "fault_record": (0x801B, 0, [
        ("present", "u8"), ("reason", "u8"), ("exception", "u8"), ("boot_count", "u32"), ("uptime_us", "u64"),
        ("pc", "u32"), ("lr", "u32"), ("sp", "u32"), ("psr", "u32"), ("fault_status", "u32"),
        ("hard_fault_status", "u32"), ("fault_address", "u32"), ("build_id", text(32))]),
}

SENSOR = [
    ("width_px", "u16"), ("height_px", "u16"), ("bits", "u8"), ("min_exposure_us", "u32"),
    ("max_exposure_us", "u32"), ("readout_us", "u32"), ("gain_e_per_dn", "f32"), ("full_well_e", "f32"),
    ("read_noise_e", "f32"), ("black_level_dn", "f32"), ("dark_current_e_per_s", "f32"),
    ("dark_doubling_K", "f32"), ("reference_temperature_mK", "i32"), ("linearity", "f32")]
OPTICS = [(n, "f32") for n in
          ("center_x_px", "center_y_px", "radius_px", "a1", "a3", "a5", "rotation_rad", "theta_max_rad",
           "image_theta_max_rad")]
ILLUMINATION = [(n, "f32") for n in
                ("theta_rad", "phi_rad", "wavelength_nm", "fwhm_nm", "angular_radius_rad")]
ILLUMINATION += [("head", "u8"), ("channel", "u8")]
CERTIFICATE = [("kind", "u8"), ("id", text(48)), ("f_per_sr", array("f32", 4)),
               ("relative_uncertainty", array("f32", 4))]
DESCRIPTOR = [
    ("product", text(32)), ("serial", text(32)), ("hardware_revision", text(32)), ("sensor", SENSOR),
    ("optics", OPTICS), ("spot_diameter_mm", "f32"), ("monitor_slope_per_K", "f32"), ("dark_lifetime_s", "u32"),
    ("reference_lifetime_s", "u32"), ("calibration_span_mK", "i32"), ("reference_stage", "u8"),
    ("transmission_module", "u8"),
    ("uncertainty", [(n, "f32") for n in ("linearity", "geometry_rad", "prnu", "monitor")]),
    ("illuminations", array(ILLUMINATION, 32)),
    ("blind_spots", array([(n, "f32") for n in ("theta_rad", "phi_rad", "radius_rad")], 16)),
    ("certificates", array(CERTIFICATE, 4))]


def crc32c(data):
    crc = 0xFFFFFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0x82F63B78 if crc & 1 else 0)
    return crc ^ 0xFFFFFFFF


def cobs(data):
    out = bytearray()
    for index, part in enumerate(data.split(b"\0")):
        # A full group of 254 is followed by another group only when more data come.
        while len(part) >= 254:
            out += b"\xff" + part[:254]
            part = part[254:]
            if not part and index == data.count(b"\0"):
                return bytes(out)
        out += bytes([len(part) + 1]) + part
    return bytes(out)


def encode(kind, value):
    if isinstance(kind, str):
        return struct.pack(SCALARS[kind], value)
    if isinstance(kind, list):
        return b"".join(encode(k, value[n]) for n, k in kind)
    if kind[0] == "text":
        data = value.encode()
        return struct.pack("<H", len(data)) + data
    if kind[0] == "array":
        return struct.pack("<H", len(value)) + b"".join(encode(kind[1], v) for v in value)
    return bytes.fromhex(value)  # raw and bytes


class Flavour:
    """Makes a value of any kind: smallest, largest, or something in between that depends on its place."""

    def __init__(self, name):
        self.name = name
        self.state = 1

    def number(self):
        self.state = self.state * 1103515245 + 12345 & 0x7FFFFFFF
        return self.state >> 8

    def scalar(self, kind):
        if kind == "f32":
            return {"min": 0.0, "max": 3.4028234663852886e38}.get(self.name, (self.number() % 4096 - 2048) / 64.0)
        bits = 8 * struct.calcsize(SCALARS[kind])
        signed = kind[0] == "i"
        if self.name == "min":
            return -(1 << bits - 1) if signed else 0
        if self.name == "max":
            return (1 << bits - signed) - 1
        return self.number() * 2654435761 % (1 << bits - 1)

    def count(self, bound):
        return {"min": 0, "max": bound}.get(self.name, 1 + self.number() % max(1, bound // 2))

    def value(self, kind):
        if isinstance(kind, str):
            return self.scalar(kind)
        if isinstance(kind, list):
            return {n: self.value(k) for n, k in kind}
        if kind[0] == "text":
            size = self.count(kind[1])
            return "é" * (size // 2) if self.name == "max" else "Scatterometer, 45° head; " [:size // 2]
        if kind[0] == "array":
            return [self.value(kind[1]) for _ in range(self.count(kind[2]))]
        size = kind[1] if kind[0] == "raw" else {"min": 0, "max": 900}.get(self.name, 37)
        return bytes({"min": 0, "max": 255}.get(self.name, self.number() & 255) for _ in range(size)).hex()


def frame(message, payload, *, magic=0x5CA7, major=1, channel=0, incompatible=0, compatible=0, sequence=0,
          session=0, correlation=0, length=None):
    length = len(payload) if length is None else length
    header = struct.pack("<HBBBBHIIHH", magic, major, channel, incompatible, compatible, message, length, sequence,
                         session, correlation)
    return header + struct.pack("<I", crc32c(header)) + payload + struct.pack("<I", crc32c(payload))


HEADERS = {
    "min": {"sequence": 0, "session": 0, "correlation": 0, "compatible": 0},
    "max": {"sequence": 0xFFFFFFFF, "session": 0xFFFF, "correlation": 0xFFFF, "compatible": 0xFF},
    "typical": {"sequence": 1234567, "session": 0xBEEF, "correlation": 42, "compatible": 0},
}


def vector(name, message, flavour, fields):
    number, channel, kinds = MESSAGES[message]
    payload = encode(kinds, fields)
    header = HEADERS[flavour]
    return {"name": name, "message": message, "id": number, "header": dict(header, channel=channel),
            "fields": fields, "payload": payload.hex(),
            "frame": frame(number, payload, channel=channel, **header).hex()}


def frames():
    for message, (_, _, kinds) in MESSAGES.items():
        for flavour in ("min", "max", "typical"):
            yield vector(f"{message} {flavour}", message, flavour, Flavour(flavour).value(kinds))
    # The largest payload that any carrier takes.
    fields = {"run_id": 1, "frame_id": 2, "offset": 16368, "total": 32736,
              "data": bytes(i * 7 & 255 for i in range(16384 - 16)).hex()}
    yield vector("frame_data of 16 KiB", "frame_data", "typical", fields)


def objects():
    for flavour in ("min", "max", "typical"):
        fields = Flavour(flavour).value(DESCRIPTOR)
        yield {"name": f"descriptor {flavour}", "object": "descriptor", "fields": fields,
               "bytes": encode(DESCRIPTOR, fields).hex()}


def flip(data, bit):
    out = bytearray(data)
    out[bit // 8] ^= 1 << bit % 8
    return bytes(out)


def rejected_frames():
    good = frame(0x0008, encode(MESSAGES["credit"][2], {"run_id": 3, "may_send_until": 9}), channel=1)
    payload = good[24:-4]
    yield "1.2.1 magic", "no_magic", frame(8, payload, magic=0x5CA6, channel=1)
    yield "1.2.2 header checksum", "bad_header", flip(good, 8 * 12)
    yield "1.2.2 header checksum itself", "bad_header", flip(good, 8 * 20 + 7)
    yield "1.2.3 length over the limit", "bad_length", frame(8, payload, channel=1, length=16385)
    yield "1.2.3 largest length", "bad_length", frame(8, payload, channel=1, length=0xFFFFFFFF)
    yield "1.2.4 payload checksum", "bad_payload", flip(good, 8 * 24)
    yield "1.2.4 payload checksum itself", "bad_payload", flip(good, 8 * len(good) - 1)
    yield "1.2.4 cut short", "need_more", good[:-1]
    yield "1.4 wire major 2", "bad_version", frame(8, payload, channel=1, major=2)
    yield "1.4 wire major 0", "bad_version", frame(8, payload, channel=1, major=0)
    yield "1.5 unknown incompatible flag", "unknown_flags", frame(8, payload, channel=1, incompatible=0x80)
    yield "1.7 channel 4", "unknown_channel", frame(8, payload, channel=4)


def rejected_payloads():
    yield "4.2 array over its bound", "set_configuration", struct.pack("<H", 33) + bytes(33)
    yield "4.2 text over its bound", "key_value_get", struct.pack("<H", 33) + b"k" * 33
    yield "4.2 array of structs over its bound", "calibration_state", struct.pack("<H", 9) + bytes(9 * 28)
    yield "4.4 cut inside a scalar", "start", bytes(7)
    yield "4.4 cut inside a count", "key_value_get", b"\x01"
    yield "4.4 cut inside raw bytes", "update_begin", bytes(255)
    yield "4.4 cut inside a text", "key_value_get", struct.pack("<H", 5) + b"name"
    yield "4.7 array of scalars ends early", "set_configuration", struct.pack("<HHI", 0, 2, 100)
    yield "4.7 element ends between two fields", "calibration_state", struct.pack("<HBB", 1, 2, 3)


def tolerated():
    """Payloads that decode although they are not what this version would send."""
    hello = {"min_wire_major": 1, "max_wire_major": 1, "schema_revision": 7, "schema_digest": 0,
             "max_payload": 16384, "capabilities": 0, "build_id": "", "host_name": ""}
    yield "4.3 missing trailing fields", "hello", struct.pack("<BBH", 1, 1, 7), hello
    yield "4.3 empty payload", "start", b"", {"epoch": 0, "may_send_until": 0}
    start = {"epoch": 5, "may_send_until": 6}
    yield "4.5 extra trailing bytes", "start", struct.pack("<IIH", 5, 6, 0xFFFF), start
    yield "4.6 unknown enum value", "calibration_undo", b"\xc8", {"kind": 200}


def serial():
    good = frame(0x0006, b"", sequence=1, session=2, correlation=3)
    yield "3.1 frame without payload", good
    yield "3.1 zeros only", frame(0x0102, bytes(300), channel=2)
    for size in (200, 253, 254, 255, 508, 1024):
        yield f"3.1 no zero in {size} bytes of payload", frame(0x0102, bytes(1 + i % 255 for i in range(size)))


def main():
    good = frame(0x0006, b"", sequence=1, session=2, correlation=3)
    document = {
        "crc32c": [{"bytes": data.hex(), "crc": crc32c(data)} for data in
                   (b"", b"123456789", bytes(32), b"\xff" * 32, bytes(range(32)), bytes(range(31, -1, -1)))],
        "frames": list(frames()),
        "objects": list(objects()),
        "rejected_frames": [{"rule": r, "status": s, "bytes": b.hex()} for r, s, b in rejected_frames()],
        "rejected_payloads": [{"rule": r, "message": m, "payload": b.hex()} for r, m, b in rejected_payloads()],
        "tolerated_payloads": [{"rule": r, "message": m, "payload": b.hex(), "fields": f,
                                "canonical": encode(MESSAGES[m][2], f).hex()} for r, m, b, f in tolerated()],
        "serial": [{"rule": r, "frame": b.hex(), "line": (cobs(b) + b"\0").hex()} for r, b in serial()],
        "rejected_serial": [
            {"rule": "3.3 two frames in one block", "line": (cobs(good + good) + b"\0").hex()},
            {"rule": "3.3 half a frame in a block", "line": (cobs(good[:20]) + b"\0").hex()},
            {"rule": "3.3 group cut by a zero", "line": (cobs(good)[:5] + b"\0").hex()},
        ],
        # SPEC 6.4: these bytes are the answer to a HELLO without a common wire major, for ever.
        "version_mismatch": {
            "hello": frame(0x0001, encode(MESSAGES["hello"][2], {
                "min_wire_major": 2, "max_wire_major": 3, "schema_revision": 1, "schema_digest": 0,
                "max_payload": 16384, "capabilities": 0, "build_id": "", "host_name": ""}),
                session=0x1234, correlation=1).hex(),
            "reply": frame(0x8000, encode(MESSAGES["status_reply"][2], {
                "status": 13, "request": 1, "pending_ms": 0, "text": "no common wire version"}),
                session=0x1234, correlation=1).hex(),
        },
    }
    print("{")
    for position, (key, value) in enumerate(document.items()):
        end = "," if position + 1 < len(document) else ""
        if isinstance(value, list):
            print(f' "{key}": [')
            print(",\n".join("  " + json.dumps(item) for item in value))
            print(f" ]{end}")
        else:
            print(f' "{key}": {json.dumps(value)}{end}')
    print("}")


if __name__ == "__main__":
    main()
