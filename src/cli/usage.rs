//! Memory of the process, where the system tells (Linux), and memory in words.

/// Largest resident memory so far, in bytes.
#[must_use]
pub fn peak_memory_bytes() -> Option<u64> {
    field(
        &std::fs::read_to_string("/proc/self/status").ok()?,
        "VmHWM:",
    )
}

/// Resident memory now, in bytes.
#[must_use]
pub fn resident_bytes() -> Option<u64> {
    field(
        &std::fs::read_to_string("/proc/self/status").ok()?,
        "VmRSS:",
    )
}

fn field(status: &str, name: &str) -> Option<u64> {
    let line = status.lines().find_map(|l| l.strip_prefix(name))?;
    line.trim()
        .strip_suffix("kB")?
        .trim()
        .parse::<u64>()
        .ok()?
        .checked_mul(1024)
}

/// A number of bytes for reading.
#[must_use]
pub fn bytes_text(bytes: u64) -> String {
    const UNITS: [&str; 4] = ["KiB", "MiB", "GiB", "TiB"];
    if bytes < 1024 {
        return format!("{bytes} B");
    }
    let power = (bytes.ilog2() / 10).min(4);
    format!(
        "{:.1} {}",
        bytes as f64 / f64::from(10 * power).exp2(),
        UNITS[power as usize - 1]
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_of_proc() {
        assert_eq!(
            field("VmPeak:\t 9 kB\nVmHWM:\t    2048 kB\n", "VmHWM:"),
            Some(2 << 20)
        );
        assert_eq!(field("VmPeak:\t 9 kB\n", "VmHWM:"), None);
    }

    #[test]
    fn bytes_in_words() {
        let cases = [
            (0, "0 B"),
            (1023, "1023 B"),
            (1024, "1.0 KiB"),
            (3 << 19, "1.5 MiB"),
            (5 << 30, "5.0 GiB"),
        ];
        for (bytes, text) in cases {
            assert_eq!(bytes_text(bytes), text);
        }
        assert_eq!(bytes_text(u64::MAX), "16777216.0 TiB");
    }
}
