//! Time of day of a run: RFC 3339, with the offset from UTC that was given.

use std::time::{SystemTime, UNIX_EPOCH};

const DAY_MS: i64 = 86_400_000;
const MINUTE_MS: i64 = 60_000;

/// Time of day at which a run's time is zero.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Clock {
    /// Milliseconds since 1970-01-01T00:00:00Z.
    start_ms: i64,
    /// Offset of the written times from UTC, minutes.
    offset_min: i32,
}

impl Clock {
    /// Clock whose zero is an RFC 3339 time, such as `2026-11-26T09:00:00+01:00`; to the millisecond.
    ///
    /// # Errors
    /// The defect of the text.
    pub fn parse(text: &str) -> Result<Self, String> {
        const FORM: &str =
            "give date, time and offset from UTC, as in 2026-11-26T09:00:00+01:00 or 2026-11-26T08:00:00Z";
        let fail = || format!("`{text}` is no RFC 3339 time; {FORM}");
        let is_form = text.is_ascii()
            && text.len() >= 20
            && text.bytes().zip("dddd-dd-ddTdd:dd:dd".bytes()).all(|(b, form)| match form {
                b'd' => b.is_ascii_digit(),
                b'T' => matches!(b, b'T' | b't' | b' '),
                form => b == form,
            });
        if !is_form {
            return Err(fail());
        }
        let number = |range: std::ops::Range<usize>| text[range].parse::<i64>().map_err(|_| fail());
        let (year, month, day) = (number(0..4)?, number(5..7)?, number(8..10)?);
        let (hour, minute, second) = (number(11..13)?, number(14..16)?, number(17..19)?);
        if !(1..=12).contains(&month) || day < 1 || day > days_in_month(year, month) {
            return Err(format!("`{text}`: there is no day {day} in month {month} of {year}"));
        }
        // A leap second is the first of the next minute.
        if hour > 23 || minute > 59 || second > 60 {
            return Err(format!("`{text}`: there is no time {hour:02}:{minute:02}:{second:02}"));
        }
        let (fraction_ms, rest) = match text[19..].strip_prefix('.') {
            Some(tail) => {
                let digits = tail.bytes().take_while(u8::is_ascii_digit).count();
                let shown: String = tail[..digits].chars().chain("000".chars()).take(3).collect();
                (shown.parse::<i64>().ok().filter(|_| digits > 0).ok_or_else(fail)?, &tail[digits..])
            }
            None => (0, &text[19..]),
        };
        let offset_min = offset_min(rest).ok_or_else(fail)?;
        let seconds = (hour * 60 + minute) * 60 + second;
        let local_ms = days_from_civil(year, month, day) * DAY_MS + seconds * 1000 + fraction_ms;
        Ok(Self { start_ms: local_ms - i64::from(offset_min) * MINUTE_MS, offset_min })
    }

    /// Clock whose zero is a time of the system, in UTC.
    pub fn of_system(time: SystemTime) -> Self {
        let ms = |duration: std::time::Duration| i64::try_from(duration.as_millis()).unwrap_or(i64::MAX);
        let start_ms = time.duration_since(UNIX_EPOCH).map_or_else(|e| -ms(e.duration()), ms);
        Self { start_ms, offset_min: 0 }
    }

    /// Clock of a run at whose time `time_s` it was `text`; `None` for a text that is no time.
    pub(crate) fn of_moment(text: &str, time_s: f64) -> Option<Self> {
        let moment = Self::parse(text).ok()?;
        Some(Self { start_ms: moment.start_ms.saturating_sub(milliseconds(time_s)), ..moment })
    }

    /// The clock's zero, seconds since 1970-01-01T00:00:00Z.
    pub fn unix_s(&self) -> f64 {
        self.start_ms as f64 / 1000.0
    }

    /// Time of day at a time of the run, seconds; to the millisecond.
    pub fn at(&self, time_s: f64) -> String {
        let utc_ms = self.start_ms.saturating_add(milliseconds(time_s));
        let local_ms = utc_ms.saturating_add(i64::from(self.offset_min) * MINUTE_MS);
        let (days, ms) = (local_ms.div_euclid(DAY_MS), local_ms.rem_euclid(DAY_MS));
        let (year, month, day) = civil_from_days(days);
        let (seconds, ms) = (ms / 1000, ms % 1000);
        let (hour, minute, second) = (seconds / 3600, seconds / 60 % 60, seconds % 60);
        let offset = if self.offset_min == 0 {
            "Z".to_owned()
        } else {
            let (sign, size) = (if self.offset_min < 0 { '-' } else { '+' }, self.offset_min.abs());
            format!("{sign}{:02}:{:02}", size / 60, size % 60)
        };
        format!("{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}.{ms:03}{offset}")
    }

    /// Seconds from the local midnight before a time of the run, to that time.
    pub(crate) fn seconds_of_day(&self, time_s: f64) -> f64 {
        let utc_ms = self.start_ms.saturating_add(milliseconds(time_s));
        let local_ms = utc_ms.saturating_add(i64::from(self.offset_min) * MINUTE_MS);
        local_ms.rem_euclid(DAY_MS) as f64 / 1000.0
    }
}

/// Milliseconds of a time; at most about 3000 years, so that dates stay printable.
fn milliseconds(time_s: f64) -> i64 {
    (time_s.clamp(-1e11, 1e11) * 1000.0).round() as i64
}

/// Offset from UTC in minutes: `Z`, `+01:00`.
fn offset_min(text: &str) -> Option<i32> {
    if matches!(text, "Z" | "z") {
        return Some(0);
    }
    let sign = match text.as_bytes().first()? {
        b'+' => 1,
        b'-' => -1,
        _ => return None,
    };
    let (hours, minutes) = text[1..].split_once(':')?;
    let two = |digits: &str| {
        let is_two = digits.len() == 2 && digits.bytes().all(|b| b.is_ascii_digit());
        digits.parse::<i32>().ok().filter(|_| is_two)
    };
    let (hours, minutes) = (two(hours)?, two(minutes)?);
    (hours <= 23 && minutes <= 59).then_some(sign * (60 * hours + minutes))
}

fn days_in_month(year: i64, month: i64) -> i64 {
    let next = if month == 12 { (year + 1, 1) } else { (year, month + 1) };
    days_from_civil(next.0, next.1, 1) - days_from_civil(year, month, 1)
}

/// Days from 1970-01-01 to a date of the Gregorian calendar (H. Hinnant, "chrono-compatible low-level date algorithms").
pub(crate) fn days_from_civil(year: i64, month: i64, day: i64) -> i64 {
    let year = if month <= 2 { year - 1 } else { year };
    let era = year.div_euclid(400);
    let year_of_era = year - era * 400;
    let day_of_year = (153 * ((month + 9) % 12) + 2) / 5 + day - 1;
    let day_of_era = year_of_era * 365 + year_of_era / 4 - year_of_era / 100 + day_of_year;
    era * 146_097 + day_of_era - 719_468
}

/// Year, month and day of a number of days since 1970-01-01 (the inverse, from the same source).
pub(crate) fn civil_from_days(days: i64) -> (i64, i64, i64) {
    let days = days + 719_468;
    let era = days.div_euclid(146_097);
    let day_of_era = days - era * 146_097;
    let year_of_era = (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let shifted = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * shifted + 2) / 5 + 1;
    let month = if shifted < 10 { shifted + 3 } else { shifted - 9 };
    (year_of_era + era * 400 + i64::from(month <= 2), month, day)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn times_are_written_with_the_offset_that_was_given() {
        let clock = Clock::parse("2026-11-26T23:59:59.5+01:00").unwrap();
        assert_eq!(clock.at(0.0), "2026-11-26T23:59:59.500+01:00");
        assert_eq!(clock.at(0.75), "2026-11-27T00:00:00.250+01:00");
        assert_eq!(clock.at(-86_400.0), "2026-11-25T23:59:59.500+01:00");
        assert_eq!(Clock::parse("2024-02-28t23:00:00z").unwrap().at(3600.0), "2024-02-29T00:00:00.000Z");
        assert!((clock.seconds_of_day(1.0) - 0.5).abs() < 1e-9);
        // `date -u -d @1700000000`.
        let known = UNIX_EPOCH + std::time::Duration::from_secs(1_700_000_000);
        assert_eq!(Clock::of_system(known).at(0.0), "2023-11-14T22:13:20.000Z");
    }

    #[test]
    fn what_is_no_time_is_refused_with_the_mend() {
        for (text, words) in [
            ("yesterday", "2026-11-26T09:00:00+01:00"),
            ("2026-11-26T09:00:00", "offset"),
            ("2026-11-26", "offset"),
            ("2026-02-29T09:00:00Z", "no day 29 in month 2"),
            ("2026-13-01T09:00:00Z", "month 13"),
            ("2026-11-26T24:00:00Z", "no time 24:00:00"),
            ("2026-11-26T09:00:00+1:00", "offset"),
            ("2026-11-26T09:00:00.Z", "offset"),
            ("2026-11-26T09:00:00é", "offset"),
        ] {
            let said = Clock::parse(text).unwrap_err();
            assert!(said.contains(words) && said.contains(text), "{said}");
        }
    }

    proptest! {
        #[test]
        fn dates_go_back_and_forth(days in -1_000_000_i64..1_000_000) {
            let (year, month, day) = civil_from_days(days);
            prop_assert_eq!(days_from_civil(year, month, day), days);
            prop_assert!((1..=12).contains(&month) && (1..=31).contains(&day));
        }

        /// A clock that is read back from any of its times is the same clock.
        #[test]
        fn a_clock_is_known_from_any_of_its_moments(time_us in 0_i64..90_000_000_000, start in 0_i64..4_000_000_000_000) {
            let time_s = time_us as f64 / 1e6;
            let clock = Clock { start_ms: start, offset_min: -210 };
            prop_assert_eq!(Clock::of_moment(&clock.at(time_s), time_s), Some(clock));
        }
    }
}
