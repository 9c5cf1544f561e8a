//! Ends of a run: outputs are finished however it ends.

use super::*;

/// Output that records whether it was finished, and after how many moments.
struct Finish<'a>(u32, &'a std::cell::Cell<Option<u32>>);
impl Output for Finish<'_> {
    fn put(&mut self, _: &ProcessedMoment<'_>) -> Result<()> {
        self.0 += 1;
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<()> {
        self.1.set(Some(self.0));
        Ok(())
    }
}

/// Output that cannot be finished.
struct Unfinished;
impl Output for Unfinished {
    fn put(&mut self, _: &ProcessedMoment<'_>) -> Result<()> {
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<()> {
        Err(Error::option("unfinished", "the disk is full"))
    }
}

#[test]
fn outputs_are_finished_however_a_run_ends() {
    let (folder, room) = recorded(&[("a", 9), ("b", 9)]);
    let run_until = |last: u32, threads: usize| {
        let clocks = vec![(Times::steady(10.0).unwrap(), 0.0); 2];
        let (finished, mut moments) = (std::cell::Cell::new(None), 0);
        let report = run(
            gathered(folder.path(), &room, threads, &clocks, MASKS).unwrap(),
            &mut Late(0.25),
            vec![Box::new(Unfinished), Box::new(Finish(0, &finished))],
            None,
            threads,
            |step| {
                moments += u32::from(step == RunProgress::Moment);
                if moments == last { RunDirective::Stop } else { RunDirective::GoOn }
            },
        );
        (
            report.map(|r| (r.frames, r.timings.frames, r.unless_failed().unwrap_err().to_string())),
            finished.get(),
        )
    };
    for threads in [1, 2] {
        let (report, finished) = run_until(4, threads);
        let (frames, timed, said) = report.unwrap();
        assert_eq!((frames, timed, finished), (4, 4, Some(4)));
        assert!(said.contains("disk is full"), "{said}");
    }
    std::fs::write(folder.path().join("b/005.png"), "torn").unwrap();
    for threads in [1, 2] {
        let (report, finished) = run_until(u32::MAX, threads);
        let (frames, timed, said) = report.unwrap();
        assert_eq!((frames, timed, finished), (5, 5, Some(5)));
        assert!(said.contains("005.png"), "what went wrong first is reported: {said}");
    }
    let first = folder.path().join("a/000.png");
    let whole = std::fs::read(&first).unwrap();
    std::fs::write(first, &whole[..whole.len() / 2]).unwrap();
    let (report, finished) = run_until(u32::MAX, 1);
    assert!(report.unwrap_err().to_string().contains("000.png"));
    assert_eq!(finished, None, "there is nothing to be written");
}
