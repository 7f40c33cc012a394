//! A folder that is gone when the render ends.

use super::{fresh, penumbra, succeeds};
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

/// Renders in `folder` until `goes` may have gone, with `temporary` as the folder of temporary files.
fn render_while(folder: &Path, temporary: &Path, outputs: &[&str], goes: &Path) -> Output {
    let mut program = Command::new(env!("CARGO_BIN_EXE_penumbra"));
    program.args(["render", "cornell", "--resolution", "32x24", "--time-limit", "2"]);
    outputs.iter().for_each(|output| {
        program.args(["-o", output]);
    });
    let child = program
        .current_dir(folder)
        .env("TMPDIR", temporary)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // It has looked for the folder by then.
    std::thread::sleep(Duration::from_millis(1000));
    std::fs::remove_dir_all(goes).unwrap();
    let start = Instant::now();
    let output = child.wait_with_output().unwrap();
    assert!(start.elapsed() < Duration::from_secs(30));
    output
}

fn error(output: Output) -> String {
    assert_eq!(output.status.code(), Some(1));
    let said = String::from_utf8(output.stderr).unwrap();
    let errors: Vec<&str> = said.lines().filter(|line| line.starts_with("error: ")).collect();
    assert_eq!(errors.len(), 1, "one line: {said}");
    errors[0].to_owned()
}

#[cfg(unix)]
#[test]
fn a_film_whose_folder_is_gone_is_saved_elsewhere() {
    let folder = fresh("lost");
    let temporary = folder.join("temporary");
    std::fs::create_dir_all(folder.join("out")).unwrap();
    std::fs::create_dir_all(&temporary).unwrap();
    // Somebody's work has that name already where it could go.
    std::fs::write(folder.join("a.film"), "something else").unwrap();
    let outputs = ["out/a.film", "out/a.png", "kept.exr"];
    let said = error(render_while(&folder, &temporary, &outputs, &folder.join("out")));
    for word in ["out/a.film", "a-1.film instead", "out/a.png", "a.png instead"] {
        assert!(said.contains(word), "{word} in {said}");
    }
    assert!(folder.join("kept.exr").is_file(), "the others are where they should be");
    assert_eq!(std::fs::read(folder.join("a.film")).unwrap(), b"something else");
    succeeds(&folder, &["merge", "a-1.film", "-o", "b.png", "--allow-gaps"]);
    assert!(folder.join("a.png").is_file());

    // The current folder is gone as well.
    let gone = folder.join("gone");
    std::fs::create_dir_all(&gone).unwrap();
    let said = error(render_while(&gone, &temporary, &["a.film"], &gone));
    assert!(said.contains("temporary/a.film instead"), "{said}");
    let (code, said) = penumbra(&folder, &["merge", "temporary/a.film", "-o", "c.png", "--allow-gaps"]);
    assert_eq!(code, Some(0), "{said}");

    // So are all places.
    std::fs::create_dir_all(&gone).unwrap();
    let said = error(render_while(&gone, &gone, &["a.film"], &gone));
    assert!(said.contains("no other place"), "{said}");
}
