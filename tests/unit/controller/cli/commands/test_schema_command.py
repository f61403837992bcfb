"""The schemas of the documents, all or one."""

import json


def test_one_schema_or_all_are_printed_and_another_word_is_refused(armload):
    every = json.loads(armload("schema").stdout)
    assert {"payload", "recordings"} <= set(every)
    one = armload("schema", "payload")
    assert json.loads(one.stdout) == every["payload"]
    assert one.stdout.startswith('{\n  "')
    refused = armload("schema", "nonsense")
    assert refused.exit_code == 2
    assert "'nonsense': expected one of" in refused.output
