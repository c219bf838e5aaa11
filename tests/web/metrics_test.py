"""/metrics of a run, read by the parser of Prometheus' own client library. usage: metrics_test.py IMUD IMU_TRUTH"""
import json
import pathlib
import re
import signal
import sys
import urllib.request

from imud_page import Imud, wait_until

try:
    from prometheus_client.openmetrics.parser import text_string_to_metric_families
    from prometheus_client.parser import text_string_to_metric_families as families_of_text_format
except ImportError:
    sys.exit("python3-prometheus-client is missing: install it by tools/setup")


def get(path, accept="application/openmetrics-text"):
    request = urllib.request.Request(f"http://{imud.address}{path}", headers={"Accept": accept})
    with urllib.request.urlopen(request) as answer:
        return answer.headers, answer.read().decode()


def call(method, **params):
    request = urllib.request.Request(f"http://{imud.address}/api", headers={"Content-Type": "application/json"},
                                     data=json.dumps({"jsonrpc": "2.0", "id": 1, "method": method, "params": params}).encode())
    with urllib.request.urlopen(request) as answer:
        return json.loads(answer.read())


def samples():
    headers, text = get("/metrics")
    assert headers["Content-Type"] == "application/openmetrics-text; version=1.0.0; charset=utf-8", headers["Content-Type"]
    return {(s.name, tuple(sorted(s.labels.items()))): s.value for family in text_string_to_metric_families(text)
            for s in family.samples}


imud = Imud(sys.argv[1], sys.argv[2])
try:
    imus = [(("imu", "imu1"),), (("imu", 'tail "left"'),)]
    wait_until("200 samples", lambda: samples()["imud_imu_samples_total", imus[1]] > 200)
    wait_until("50 truths", lambda: samples()["imud_truth_accepted_total", ()] > 50)
    all_samples = samples()
    assert len(all_samples) > 150, len(all_samples)
    counters = call("status")["result"]["counters"]
    later = samples()
    for labels, imu in zip(imus, counters["imus"]):
        for key, value in imu.items():
            if isinstance(value, int):
                names = [n for n in (f"imud_imu_{key}_total", f"imud_imu_{key}") if (n, labels) in later]
                assert len(names) == 1, f"{key}: {names}"
                assert all_samples[names[0], labels] <= value <= later[names[0], labels], key
        count = later["imud_imu_lateness_seconds_count", labels]
        assert count == later["imud_imu_lateness_seconds_bucket", (labels[0], ("le", "+Inf"))] > 100
    assert later["imud_truth_accepted_total", ()] >= counters["truth"]["accepted"] > 50
    assert later["imud_imu_line_load_ratio", imus[0]] > 0.1, "stim300 on its line"

    # Truth stops: how long ago is a figure.
    since_newest = lambda: samples()["imud_truth_since_newest_seconds", ()]  # noqa: E731
    wait_until("a new truth", lambda: since_newest() < 0.2)
    imud.truth.send_signal(signal.SIGSTOP)
    wait_until("a second without truth", lambda: since_newest() > 1)
    imud.truth.send_signal(signal.SIGCONT)
    wait_until("a new truth again", lambda: since_newest() < 0.2)

    # The text format, by its own parser, has the same figures.
    headers, text = get("/metrics", "*/*")
    assert headers["Content-Type"] == "text/plain; version=0.0.4; charset=utf-8", headers["Content-Type"]
    families = list(families_of_text_format(text))
    assert all(family.documentation and family.type != "unknown" for family in families)
    seen = {(s.name, tuple(sorted(s.labels.items()))) for family in families for s in family.samples}
    assert seen == set(samples()), seen ^ set(samples())

    # The board of Grafana asks for metrics that there are.
    board = json.loads((pathlib.Path(__file__).parents[2] / "tools/grafana/imud.json").read_text())
    expressions = [target["expr"] for panel in board["panels"] for target in panel["targets"]]
    assert len(expressions) >= 12, expressions
    asked = {name for expression in expressions for name in re.findall(r"imud_\w+", expression)}
    assert asked <= {name for name, _ in seen}, asked - {name for name, _ in seen}

    result = call("pause", imu="imu1")["result"]
    assert result["applied"][0]["imu"] == "imu1" and result["applied"][0]["sample"] > 100, result
    assert re.search("not found", call("no such method")["error"]["message"])
    refused = call("subscribe", what="samples")
    assert "error" in refused, refused
finally:
    code = imud.stop()
    print("".join(imud.log))
assert code == 0, f"imud has ended with {code}"
