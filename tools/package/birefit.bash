# Completion for bash: commands and options are those that the program's own help lists.
_birefit() {
  local word=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD - 1]} command=${COMP_WORDS[1]}
  COMPREPLY=()
  if ((COMP_CWORD == 1)); then
    mapfile -t COMPREPLY < <(compgen -W "$("$1" --help 2> /dev/null | awk '/^Subcommands:/ { on = 1; next } /^$/ { on = 0 } on { print $1 } /^  -.*--/ { sub(/.*--/, "--"); print $1 }')" -- "$word")
  elif [[ $word == -* ]]; then
    mapfile -t COMPREPLY < <(compgen -W "$("$1" "$command" --help 2> /dev/null | grep -o -- '^  *\(-[a-z],\)\?--[a-z-]*' | grep -o -- '--[a-z-]*')" -- "$word")
  elif [[ $command == new && $before == new ]]; then
    mapfile -t COMPREPLY < <(compgen -W "$("$1" new 2> /dev/null | awk '/^  [a-z]/ { print $1 }')" -- "$word")
  else
    compopt -o default 2> /dev/null
  fi
}
complete -F _birefit birefit
