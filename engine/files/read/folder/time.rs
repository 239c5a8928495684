//! Dates and times of day in the names of files: their numbers are one value, which rolls over in parts.

use super::name::Column;

/// Digits of a year with month and day, of a time of day, and of both.
const DATE: usize = 8;
const TIME: usize = 6;
const BOTH: usize = 14;
/// Digits of fractions of a second behind a time.
const FRACTIONS: [usize; 2] = [3, 6];
/// Steps of times without a date are at most this factor and this number of seconds above the least step: other
/// numbers of two digits, such as views and steps with some missing, are less even.
const EVEN: (f64, f64) = (1.5, 1.0);

/// Values of one column for each name, and the place of the next column.
type Part = (Vec<i128>, usize);

/// The columns with a date, a time of day or both as one; `None` where they hold none.
pub(super) fn with_time(columns: &[Column]) -> Option<Vec<Column>> {
    let joined = |start: usize| {
        let Some((days, next)) = date(columns, start) else {
            return time(columns, start).filter(|(seconds, _)| is_even(seconds));
        };
        let midnights = days.iter().map(|day| day * 86_400);
        match time(columns, next).filter(|_| columns[next].is_joined) {
            Some((seconds, end)) => {
                Some((midnights.zip(seconds).map(|(day, it)| day + it).collect(), end))
            }
            None => Some((midnights.collect(), next)),
        }
    };
    let both = |start: usize| {
        let column = columns.get(start).filter(|column| is_whole(column, BOTH))?;
        let days = days(split(column, 1_000_000).0)?;
        let seconds = seconds(split(column, 1_000_000).1)?;
        let sum = days.iter().zip(seconds).map(|(day, second)| day * 86_400 + second);
        Some((sum.collect(), start + 1))
    };
    let (start, (mut values, mut end)) = (0..columns.len())
        .find_map(|start| Some((start, both(start).or_else(|| joined(start))?)))?;
    let mut decimals = 0;
    let digits = |column: &&Column| column.is_joined && column.decimals == 0;
    let fraction = columns.get(end).filter(digits);
    if let Some((column, digits)) = fraction.and_then(|it| Some((it, it.digits?)))
        && FRACTIONS.contains(&digits)
    {
        decimals = digits;
        end += 1;
        let scale = 10_i128.pow(if digits == FRACTIONS[0] { 3 } else { 6 });
        let scaled = values.iter().zip(&column.values).map(|(value, part)| value * scale + part);
        values = scaled.collect();
    }
    let time = Column { values, decimals, measures: true, digits: None, is_joined: false };
    let mut all = columns[..start].to_vec();
    all.push(time);
    all.extend_from_slice(&columns[end..]);
    Some(all)
}

/// Day numbers of a date that begins with a column, ascending with the date.
fn date(columns: &[Column], start: usize) -> Option<Part> {
    let first = columns.get(start)?;
    if is_whole(first, DATE) {
        return Some((days(first.values.clone())?, start + 1));
    }
    let [year, month, day] = columns.get(start..start + 3)? else { return None };
    let is_date =
        is_whole(year, 4) && [month, day].iter().all(|it| is_whole(it, 2) && it.is_joined);
    let parts = year.values.iter().zip(&month.values).zip(&day.values);
    let whole = parts.map(|((year, month), day)| (year * 100 + month) * 100 + day).collect();
    Some((days(whole).filter(|_| is_date)?, start + 3))
}

/// Seconds of a time of day that begins with a column.
fn time(columns: &[Column], start: usize) -> Option<Part> {
    let first = columns.get(start)?;
    if is_whole(first, TIME) {
        return Some((seconds(first.values.clone())?, start + 1));
    }
    let [hour, minute, second] = columns.get(start..start + 3)? else { return None };
    let is_time = [hour, minute, second].iter().all(|it| is_whole(it, 2));
    let is_joined = minute.is_joined && second.is_joined;
    let parts = hour.values.iter().zip(&minute.values).zip(&second.values);
    let whole = parts.map(|((hour, minute), second)| (hour * 100 + minute) * 100 + second);
    Some((seconds(whole.collect()).filter(|_| is_time && is_joined)?, start + 3))
}

/// True for whole numbers that have this number of digits in all names.
fn is_whole(column: &Column, digits: usize) -> bool {
    column.digits == Some(digits) && column.decimals == 0 && !column.measures
}

/// Values over a unit, and the rest.
fn split(column: &Column, unit: i128) -> (Vec<i128>, Vec<i128>) {
    column.values.iter().map(|value| (value / unit, value % unit)).unzip()
}

/// Day numbers of dates `YYYYMMDD`, with months of 31 days.
fn days(dates: Vec<i128>) -> Option<Vec<i128>> {
    let day = |date: i128| {
        let [year, month, day] = [date / 10_000, date / 100 % 100, date % 100];
        let is_date =
            (1900..2200).contains(&year) && (1..=12).contains(&month) && (1..=31).contains(&day);
        is_date.then_some((year * 12 + month) * 31 + day)
    };
    dates.into_iter().map(day).collect()
}

/// Seconds of times `HHMMSS`.
fn seconds(times: Vec<i128>) -> Option<Vec<i128>> {
    let second = |time: i128| {
        let [hour, minute, second] = [time / 10_000, time / 100 % 100, time % 100];
        let is_time = (0..24).contains(&hour) && minute < 60 && second < 60;
        is_time.then_some((hour * 60 + minute) * 60 + second)
    };
    times.into_iter().map(second).collect()
}

/// True if the steps between times are about equal.
fn is_even(seconds: &[i128]) -> bool {
    let mut ascending = seconds.to_vec();
    ascending.sort_unstable();
    ascending.dedup();
    let steps = || ascending.windows(2).map(|pair| (pair[1] - pair[0]) as f64);
    let [least, most] = [steps().fold(f64::INFINITY, f64::min), steps().fold(0.0, f64::max)];
    ascending.len() > 2 && most <= EVEN.0 * least + EVEN.1
}
