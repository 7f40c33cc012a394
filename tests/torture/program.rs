//! The command line.

use std::process::{Command, Stdio};

/// Exit code, and what was printed to either stream.
fn torture(args: &[&str]) -> (Option<i32>, String, String) {
    let mut program = Command::new(env!("CARGO_BIN_EXE_penumbra"));
    let output = program.arg("torture").args(args).stdin(Stdio::null()).output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (output.status.code(), text(output.stdout), text(output.stderr))
}

#[test]
fn cases_are_named_one_by_one_or_in_a_list_and_run_once() {
    let (code, said, _) = torture(&["--list", "--case", "g1, H6", "--case", "G1"]);
    assert_eq!(code, Some(0));
    assert_eq!(said.lines().count(), 2, "{said}");
    assert!(said.starts_with("G1 ") && said.contains("\nH6 "), "{said}");
    for args in [&["--list", "--case", "foo"][..], &["--case", "G1,foo"]] {
        let (code, said, error) = torture(args);
        assert_eq!((code, said.as_str()), (Some(2), ""));
        assert!(error.contains("--case foo"), "{error}");
    }
}

#[test]
fn programs_are_told_the_verdict() {
    let (code, said, _) = torture(&["--case", "H6", "--json", "--quick", "--quiet"]);
    assert_eq!(code, Some(0));
    assert!(said.contains("\"verdict\": \"holds\"") && said.contains("\"holds\": true"), "{said}");
}

#[test]
fn a_scene_is_shown_or_a_table_printed() {
    let (code, _, error) = torture(&["--show", "G1", "--json"]);
    assert!(code == Some(2) && error.contains("--json"), "{error}");
    let (code, _, error) = torture(&["--show", "S5"]);
    assert!(code == Some(2) && error.contains("numbers") && error.contains(" G1, "), "{error}");
    let (code, _, error) = torture(&["--show", "G3", "--open-edge"]);
    assert!(code == Some(2) && error.contains("broken"), "{error}");
}

#[cfg(unix)]
#[test]
fn an_interrupted_case_has_no_verdict() {
    let mut program = Command::new(env!("CARGO_BIN_EXE_penumbra"));
    program.args(["torture", "--case", "S5", "--long", "--json", "--quiet"]).stdin(Stdio::null());
    let child = program.stdout(Stdio::piped()).spawn().unwrap();
    std::thread::sleep(std::time::Duration::from_millis(1000));
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    let said = String::from_utf8(output.stdout).unwrap();
    assert_eq!(output.status.code(), Some(130), "{said}");
    assert!(said.contains("\"verdict\": \"cut short\""), "{said}");
}
