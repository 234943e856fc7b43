//! CPU time of the process, where the system tells (Linux), and the time that passes take.

use std::time::{Duration, Instant};

/// Unit of times in `/proc/self/stat` (USER_HZ, which the kernel fixes at 100 for user space).
const TICKS_PER_SECOND: f64 = 100.0;

/// CPU seconds of all threads so far.
#[must_use]
pub fn cpu_seconds() -> Option<f64> {
    parse_cpu_seconds(&std::fs::read_to_string("/proc/self/stat").ok()?)
}

fn parse_cpu_seconds(stat: &str) -> Option<f64> {
    // the second field, the command in parentheses, may hold blanks; utime and stime are fields 14
    // and 15
    let fields: Vec<&str> = stat.rsplit_once(')')?.1.split_whitespace().collect();
    let ticks = |i: usize| fields.get(i).and_then(|t| t.parse::<f64>().ok());
    Some((ticks(11)? + ticks(12)?) / TICKS_PER_SECOND)
}

/// Time spent on passes, and on nothing else.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PassTime {
    /// Wall time.
    pub wall: Duration,
    cpu_seconds: Option<f64>,
}

impl PassTime {
    /// CPU seconds of all threads; wall seconds where the system does not tell. The system counts
    /// CPU time in steps, so that the first may be 0: half a step then.
    #[must_use]
    pub fn cpu_seconds(&self) -> f64 {
        let seconds = self.cpu_seconds.unwrap_or(self.wall.as_secs_f64());
        seconds.max(0.5 / TICKS_PER_SECOND)
    }

    /// Runs `work` on this clock.
    pub(super) fn measure<T>(&mut self, work: impl FnOnce() -> T) -> T {
        let (wall, cpu) = (Instant::now(), cpu_seconds());
        let result = work();
        self.wall += wall.elapsed();
        let spent = cpu.and_then(|start| Some((cpu_seconds()? - start).max(0.0)));
        self.cpu_seconds = spent.map(|s| self.cpu_seconds.unwrap_or(0.0) + s);
        result
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_of_proc() {
        let stat = "7 (a b) c) R 1 7 7 0 -1 4 88 0 0 0 150 50 0 0 20 0 1 0 100 0 0";
        assert_eq!(parse_cpu_seconds(stat), Some(2.0));
        assert_eq!(parse_cpu_seconds("7 (a) R 1"), None);
    }

    #[test]
    fn only_work_counts() {
        let mut time = PassTime::default();
        assert_eq!(time.cpu_seconds(), 0.005, "half a step");
        time.measure(|| std::thread::sleep(Duration::from_millis(2)));
        let measured = time.wall;
        std::thread::sleep(Duration::from_millis(2));
        assert!(measured >= Duration::from_millis(2) && time.wall == measured);
    }
}
