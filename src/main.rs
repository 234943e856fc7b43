//! The `abbe` command: parses, runs, returns an exit code.

fn main() -> std::process::ExitCode {
    abbe::cli::run()
}
