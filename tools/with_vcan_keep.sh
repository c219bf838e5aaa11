# The part of with-vcan that keeps a guest for several commands; with-vcan reads it for --keep and --end.
# The guest sees the caller's files but not its processes: a folder carries the commands to it, and their output back.
#   lock          held by the with-vcan that runs the guest
#   ready, end    the guest has begun to take commands; it is asked to end
#   job.X.new     a command: job (directory, umask, arguments), env; the guest renames it to job.X and adds
#                 out, err and, at last, rc; `signal` in it is the name of a signal for the command
# This file needs bash, as with-vcan does.

kept_folder() {
	kept=${TMPDIR:-/tmp}/with-vcan-kept.$EUID
	mkdir -m 700 -p -- "$kept" 2>/dev/null
	[[ -O $kept && -d $kept && ! -L $kept ]] || fail "$kept: must be a folder of this user"
	kept=$(realpath -- "$kept")
}

is_kept() { ! flock -n "$kept/lock" true 2>/dev/null; }

# Prints the script that takes commands where vcan0 is. Its arguments: the folder, and the seconds to wait for another.
keeper() {
	cat <<'EOK'
cd "$1" || exit
run() {
	local job env dir mask
	mapfile -d '' -t env <"$1/env"
	mapfile -d '' -t job <"$1/job"
	dir=${job[0]} mask=${job[1]}
	(
		cd "$dir" || { echo "with-vcan: $dir: not found in the guest"; exit 125; }
		umask "$mask"
		exec setsid -w env -i -- "${env[@]}" bash -c 'echo $$ >"$1/pid"; exec -- "${@:2}"' with-vcan "$kept/$1" "${job[@]:2}"
	) </dev/null >"$1/out" 2>"$1/err"
	echo $? >"$1/rc.new"
	mv "$1/rc.new" "$1/rc"
}
kept=$1
shopt -s nullglob
exec {nap}<> <(:)
: >ready
for ((idle = SECONDS; SECONDS - idle < $2; )); do
	[[ -e end ]] && break
	for new in job.*.new; do
		mv "$new" "${new%.new}" && run "${new%.new}" &
	done
	for file in job.*/signal; do
		read -r signal <"$file" && read -r pid <"${file%signal}pid" && rm "$file" && kill -s "$signal" -- "-$pid"
	done 2>/dev/null
	[[ $(jobs -pr) ]] && idle=$SECONDS
	read -rt 0.1 <&"$nap"
done
EOK
}

start_kept() {
	local log=$kept/log job
	rm -rf -- "$kept"/{ready,end}
	# Commands whose callers wait: this guest takes them, or they were in the one before.
	for job in "$kept"/job.*; do
		[[ -d $job ]] || continue
		if ! kill -0 "$(<"$job/caller")" 2>/dev/null; then
			rm -rf -- "$job"
		elif [[ $job != *.new && ! -e $job/rc ]]; then
			echo "with-vcan: the kept guest has ended" >>"$job/err"
			echo 125 >"$job/rc"
		fi
	done 2>/dev/null
	used "a guest that is kept"
	keeper >"$kept/keeper"
	setsid flock "$kept/lock" "$here/with-vcan" bash "$kept/keeper" "$kept" "${WITH_VCAN_IDLE:-300}" \
		</dev/null >"$log" 2>&1 {start}<&- &
	local starter=$!
	disown
	while [[ ! -e $kept/ready ]]; do
		sleep 0.05
		kill -0 "$starter" 2>/dev/null || { cat "$log" >&2; exit 125; }
	done
}

# One caller at a time starts a guest.
need_kept() {
	local start
	mkdir -m 700 -p -- "$kept"
	exec {start}>"$kept/start"
	flock "$start"
	is_kept && [[ -e $kept/ready && ! -e $kept/end ]] || { flock "$kept/lock" true && start_kept; }
	exec {start}>&-
}

run_kept() {
	[[ ${WITH_VCAN_IDLE:-300} =~ ^[0-9]+$ ]] || fail "WITH_VCAN_IDLE=$WITH_VCAN_IDLE: give it in whole seconds"
	local job out err signal
	kept_folder
	need_kept
	job=$(mktemp -d "$kept/job.XXXXXX") || fail "cannot write in $kept"
	: >"$job/out"
	: >"$job/err"
	exec {out}<"$job/out" {err}<"$job/err"
	cat "/proc/$$/environ" >"$job/env"
	printf '%s\0' "$PWD" "$(umask)" "$@" >"$job/job"
	echo $$ >"$job/caller"
	mv -- "$job" "$job.new"
	for signal in HUP INT TERM; do trap "echo $signal >'$job/signal'" "$signal"; done
	while [[ ! -e $job/rc ]]; do
		sleep 0.05
		cat <&"$out"
		cat <&"$err" >&2
		[[ -e $job/rc ]] || is_kept && continue
		# It may have ended before it took the command.
		if [[ -d $job.new ]]; then need_kept; elif [[ ! -e $job/rc ]]; then fail "the kept guest has ended: $(tail -n 1 "$kept/log")"; fi
	done
	cat <&"$out"
	cat <&"$err" >&2
	signal=$(<"$job/rc")
	rm -rf -- "$job"
	exit "$signal"
}

end_kept() {
	kept_folder
	is_kept || exit 0
	: >"$kept/end"
	flock "$kept/lock" rm -rf -- "$kept"
	exit 0
}
