//! The Python environment of these tests, made once in the target folder (`requirements.txt` pins
//! versions and hashes).
//!
//! Without Python 3 or network a test fails; `ABBE_SKIP_PYTHON=1` skips it. `PYTHON` names another
//! interpreter.

use serde_json::Value;
use std::fs::{self, File};
use std::hash::{DefaultHasher, Hash, Hasher};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

const REQUIREMENTS: &str = include_str!("requirements.txt");
const OPT_OUT: &str = "ABBE_SKIP_PYTHON=1 skips the tests that need Python";

/// The interpreter of the environment, made first if need be; `None` if Python is opted out.
pub fn python() -> Option<PathBuf> {
    if std::env::var("ABBE_SKIP_PYTHON").is_ok_and(|v| v == "1") {
        println!("skipped: ABBE_SKIP_PYTHON=1");
        return None;
    }
    let mut hasher = DefaultHasher::new();
    REQUIREMENTS.hash(&mut hasher);
    let place = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let folder = place.join(format!("venv-{:016x}", hasher.finish()));
    let python = if cfg!(windows) {
        "Scripts/python.exe"
    } else {
        "bin/python"
    };
    let (python, complete) = (folder.join(python), folder.join(".complete"));
    fs::create_dir_all(place).unwrap();
    // Tests run in parallel, in threads and in processes: one makes the environment, the others
    // wait.
    let lock = File::create(place.join("venv.lock")).unwrap();
    lock.lock().unwrap();
    // (an interpreter that is gone leaves a dangling link)
    if !(complete.exists() && python.exists()) {
        let base = std::env::var("PYTHON").unwrap_or_else(|_| String::from("python3"));
        run(Command::new(&base)
            .args(["-m", "venv", "--clear"])
            .arg(&folder));
        let requirements = place.join("requirements.txt");
        fs::write(&requirements, REQUIREMENTS).unwrap();
        let pip = ["-m", "pip", "install", "-q", "--disable-pip-version-check"];
        let pinned = ["--only-binary=:all:", "--require-hashes", "--no-deps", "-r"];
        run(Command::new(&python)
            .args(pip)
            .args(pinned)
            .arg(&requirements));
        File::create(&complete).unwrap();
    }
    Some(python)
}

fn run(command: &mut Command) {
    let shown = format!("{command:?}");
    match command.output() {
        Ok(output) if output.status.success() => {}
        Ok(output) => {
            let error = String::from_utf8_lossy(&output.stderr);
            panic!("{shown} failed ({OPT_OUT}):\n{error}");
        }
        Err(error) => panic!("{shown}: {error} (Python 3 is needed; {OPT_OUT})"),
    }
}

/// Answers of check.py to the cases, one each.
pub fn check(python: &Path, cases: &[Value]) -> Vec<Value> {
    let input = serde_json::to_vec(cases).unwrap();
    let text = run_script(python, "check.py", &[], &input);
    let answers: Vec<Value> = text
        .lines()
        .map(|l| serde_json::from_str(l).unwrap())
        .collect();
    assert_eq!(answers.len(), cases.len());
    answers
}

/// An image as read_exr.py reads it.
pub fn read_exr(python: &Path, image: &Path) -> Value {
    serde_json::from_str(&run_script(python, "read_exr.py", &[image], &[])).unwrap()
}

fn run_script(python: &Path, script: &str, arguments: &[&Path], input: &[u8]) -> String {
    let mut child = Command::new(python)
        .arg("-I")
        .arg(
            Path::new(env!("CARGO_MANIFEST_DIR"))
                .join("tests/colour")
                .join(script),
        )
        .args(arguments)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // a script that ends early says why below
    _ = child.stdin.take().unwrap().write_all(input);
    let output = child.wait_with_output().unwrap();
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{script} failed:\n{error}");
    String::from_utf8(output.stdout).unwrap()
}
