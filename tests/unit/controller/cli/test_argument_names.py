"""Messages in the words of the command line."""

from armload_controller.cli.argument_names import as_options


def test_arguments_of_python_become_options_and_other_words_stay():
    assert as_options("give `flange_rpy_rad=` or `robot=`, `single=` and `between_s=`") == (
        "give --flange-rpy-rad or ROBOT, --float and --between"
    )
    assert as_options("`a = 1`, a=2 and `b`") == "`a = 1`, a=2 and `b`"
